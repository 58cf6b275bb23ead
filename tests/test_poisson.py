import dataclasses
import importlib.util

import numpy as np
import pytest
import reference
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation
from tet_meshes import cage_mesh, grid_mesh, tet_volumes

from face_plugin import MissingDependencyError
from face_plugin.faraday import domain, field
from face_plugin.faraday.balls import build_balls
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.meshers.delaunay import delaunay_mesh
from face_plugin.faraday.poisson import Poisson
from face_plugin.geometry import local_spacing


def small_mesh(count=9, seed=0):
    """Mesh as the method makes it, small enough for dense matrices."""
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 3))
    balls = build_balls(points, np.arange(count))
    box = domain.padded_box(balls, 0.1)
    filling = domain.fill(balls, local_spacing(points), box, grading=1.5, finest=3.0, seed=0)
    return delaunay_mesh(balls, filling, box)


def empty_mesh(n=6):
    """Box without a cage, its inner vertices displaced at random."""
    vertices, tets = grid_mesh(n)
    boundary = (np.abs(vertices) == 1).any(axis=1)
    vertices[~boundary] += np.random.default_rng(0).uniform(-0.2, 0.2, ((~boundary).sum(), 3)) / n
    assert tet_volumes(vertices, tets).min() > 0
    owner = np.full(len(vertices), -1, dtype=np.int32)
    return CageMesh(vertices, tets, owner, boundary, vertices.min(axis=0), vertices.max(axis=0))


def positive(vertices, tets):
    """Tetrahedra with volume, turned positive."""
    volume = tet_volumes(vertices, tets)
    tets = np.where((volume < 0)[:, None], tets[:, [1, 0, 2, 3]], tets)
    return tets[np.abs(volume) > 1e-12].astype(np.int32)


def shells_around_a_ball(level):
    """Mesh between a conducting ball of radius 1 and a sphere of radius 4; finer with the level."""
    radii = np.geomspace(1.0, 4.0, 3 * 2**level + 1)
    turns = Rotation.random(len(radii), random_state=0)
    sphere = reference.icosphere(level)
    vertices = np.concatenate([r * turn.apply(sphere) for r, turn in zip(radii, turns, strict=True)])
    shell = np.repeat(np.arange(len(radii)), len(vertices) // len(radii))
    tets = positive(vertices, Delaunay(vertices).simplices)
    tets = tets[(shell[tets] > 0).any(axis=1)]
    owner = np.where(shell == 0, 0, -1).astype(np.int32)
    return CageMesh(vertices, tets, owner, shell == shell.max(), vertices.min(axis=0), vertices.max(axis=0))


def test_linear_potential_is_reproduced_without_a_cage():
    mesh = empty_mesh()
    gradients = np.random.default_rng(1).normal(size=(3, 4))
    linear = mesh.vertices @ gradients + [1.0, -2.0, 0.0, 3.0]
    potential = Poisson(mesh).solve(linear[mesh.boundary])
    # Measured: 3e-15.
    np.testing.assert_allclose(potential, linear, atol=1e-12)
    np.testing.assert_allclose(
        field.vertex_gradients(mesh, potential), np.broadcast_to(gradients, (len(linear), 3, 4)), atol=1e-11
    )


def test_ball_in_a_uniform_field_against_the_closed_form():
    error, strength_error = [], []
    for level in (1, 2, 3):
        mesh = shells_around_a_ball(level)
        r = np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
        exact = mesh.vertices * (1 - 1 / r**3)
        potential = Poisson(mesh).solve(exact[mesh.boundary])
        error.append(np.abs(potential - exact).max())
        # Some direction is normal to the ball at each of its points: the field there is three times the outer
        # one.
        at_ball = field.strength_exact(field.vertex_gradients(mesh, potential))[mesh.owner == 0]
        strength_error.append(np.abs(at_ball - 3.0).max())
        # The vertices are symmetric about the centre, so the ball stays at its potential. Measured: 4e-15.
        assert np.abs(potential[mesh.owner == 0]).max() < 1e-12
    # Second order in the size of the elements, which is halved, for the potential; first order for the field.
    # Measured: 0.129, 0.0391, 0.0113 for potentials of up to 4; 1.17, 0.68, 0.41 for a strength of 3.
    assert error[2] < 0.015
    assert error[2] < 0.35 * error[1] < 0.35**2 * error[0]
    assert strength_error[2] < 0.65 * strength_error[1] < 0.65**2 * strength_error[0]


@pytest.mark.parametrize("solver", ["auto", "superlu"])
def test_against_dense_reference_of_equation_4(solver):
    mesh = small_mesh()
    box = mesh.vertices[mesh.boundary]
    sides = np.column_stack([box, np.random.default_rng(0).normal(size=(len(box), 2))])
    expected = reference.solve(mesh, sides)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(Poisson(mesh, solver).solve(sides), expected, atol=1e-9 * scale)


def test_matrix_is_symmetric_and_positive_definite():
    mesh = cage_mesh(np.random.default_rng(2).normal(size=(12, 3)), np.random.default_rng(3), free=300)
    matrix = Poisson(mesh).matrix.toarray()
    np.testing.assert_allclose(matrix, matrix.T, rtol=0, atol=1e-14 * np.abs(matrix).max())
    assert np.linalg.eigvalsh(matrix).min() > 0


def test_matrix_is_the_free_block_of_the_laplacian():
    mesh = small_mesh()
    L = reference.laplacian(mesh)
    poisson = Poisson(mesh)
    np.testing.assert_allclose(poisson.matrix.toarray(), L[np.ix_(poisson.free, poisson.free)], atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_floating_cage_carries_no_charge(seed):
    mesh = small_mesh(count=6 + seed, seed=seed)
    box = mesh.vertices[mesh.boundary]
    potential = Poisson(mesh).solve(np.column_stack([box, np.random.default_rng(seed).normal(size=len(box))]))
    flux = (reference.laplacian(mesh) @ potential)[mesh.owner >= 0]
    assert np.abs(flux.sum(axis=0)).max() < 1e-12 * np.abs(flux).sum()
    assert np.ptp(potential[mesh.owner >= 0], axis=0).max() == 0


def test_cage_that_touches_tetrahedra_of_the_box():
    """With nothing between them, the stiffness between the cage and the box takes part in the balance."""
    mesh = small_mesh(count=4)
    keep = (mesh.owner >= 0) | mesh.boundary
    vertices = mesh.vertices[keep]
    tets = positive(vertices, Delaunay(vertices, qhull_options="Qbb Qc Qz Q12").simplices)
    owner = mesh.owner[keep]
    inside = (owner[tets] == owner[tets[:, :1]]).all(axis=1) & (owner[tets[:, 0]] >= 0)
    tets = tets[~inside]
    # One free vertex, far from most of the cage: a system has to be solved.
    middle = np.flatnonzero((owner[tets] < 0).sum(axis=1) == 2)[0]
    vertices = np.concatenate([vertices, vertices[tets[middle]].mean(axis=0, keepdims=True)])
    a, b, c, d = tets[middle]
    new = len(vertices) - 1
    four = [[new, b, c, d], [a, new, c, d], [a, b, new, d], [a, b, c, new]]
    tets = np.concatenate([np.delete(tets, middle, axis=0), four]).astype(np.int32)
    owner, boundary = np.append(owner, -1).astype(np.int32), np.append(mesh.boundary[keep], False)
    mesh = CageMesh(vertices, tets, owner, boundary, mesh.lower, mesh.upper)
    box = vertices[boundary]
    np.testing.assert_allclose(Poisson(mesh).solve(box), reference.solve(mesh, box), atol=1e-12)


def test_given_cage_potential_and_superposition():
    poisson = Poisson(small_mesh())
    mesh = poisson.mesh
    box = mesh.vertices[mesh.boundary]
    held = poisson.solve(box, np.array([1.0, -2.0, 0.5]))
    np.testing.assert_array_equal(held[mesh.owner >= 0], np.tile([1.0, -2.0, 0.5], ((mesh.owner >= 0).sum(), 1)))
    np.testing.assert_array_equal(held[mesh.boundary], box)
    v = np.array([[0.6], [0.0], [-0.8]])
    np.testing.assert_allclose(poisson.solve(box @ v), poisson.solve(box) @ v, atol=1e-12)
    # With the box and the cage at one potential there is no field.
    constant = poisson.solve(np.ones((len(box), 1)))
    np.testing.assert_allclose(constant, 1.0, atol=1e-12)


def test_cholmod_agrees_with_superlu_or_says_what_to_install(demo_face):
    mesh = demo_face.mesh
    box = mesh.vertices[mesh.boundary]
    if importlib.util.find_spec("sksparse") is None:
        with pytest.raises(MissingDependencyError, match=r"face-plugin\[cholmod\]"):
            Poisson(mesh, "cholmod")
    else:
        # Measured: 1e-15.
        np.testing.assert_allclose(Poisson(mesh, "cholmod").solve(box), Poisson(mesh, "superlu").solve(box), atol=1e-12)


def test_order_of_tetrahedra_does_not_matter():
    mesh = small_mesh()
    box = mesh.vertices[mesh.boundary]
    shuffled = dataclasses.replace(mesh, tets=np.random.default_rng(0).permutation(mesh.tets))
    np.testing.assert_allclose(Poisson(shuffled).solve(box), Poisson(mesh).solve(box), atol=1e-13)
