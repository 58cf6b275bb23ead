"""One suite for the meshers."""

import dataclasses
import itertools
from collections import Counter

import numpy as np
import pytest
from cages import BALL, caged
from scipy.spatial import cKDTree
from tet_meshes import tet_volumes

from face_plugin import FaCE, Params, estimate_normals, shapes
from face_plugin.faraday import domain
from face_plugin.faraday.balls import SOLIDS
from face_plugin.faraday.meshers import delaunay
from face_plugin.faraday.meshers.boundary import ball_volumes, boundary_surface, oriented
from face_plugin.faraday.meshers.select import build_mesh

CASES = {
    "gmsh, octahedra": Params(mesher="delaunay"),
    "gmsh, icosahedra": Params(mesher="delaunay", solid="icosahedron"),
    "scipy": Params(mesher="delaunay"),
    "tetgen, icosahedra": Params.paper(),
    "tetgen, octahedra": Params(mesher="tetgen"),
    "tetwild": Params(mesher="tetwild"),
}


@pytest.fixture(scope="module", params=CASES)
def made(request):
    params = CASES[request.param]
    balls, spacing, box = caged(shapes.torus(200).points, params.solid)
    if request.param == "scipy":
        filling = domain.fill(balls, spacing, box, grading=params.grading, finest=params.finest, seed=0)
        return balls, box, delaunay.delaunay_mesh(balls, filling, box, "scipy")
    return balls, box, build_mesh(balls, spacing, box, params)


def test_volumes_are_positive_and_add_up(made):
    balls, box, mesh = made
    volume = tet_volumes(mesh.vertices, mesh.tets)
    assert volume.min() > 0
    solids = ball_volumes(balls).sum()
    # Every mesher keeps the solids to rounding; measured up to 1e-15.
    assert volume.sum() == pytest.approx(np.prod(box.upper - box.lower) - solids, rel=1e-12)


def test_cage_vertices_lie_on_their_balls_and_balls_are_disjoint(made):
    balls, _, mesh = made
    on_ball = np.flatnonzero(mesh.owner >= 0)
    owner = mesh.owner[on_ball]
    distance = np.linalg.norm(mesh.vertices[on_ball] - balls.centres[owner], axis=1) / balls.radii[owner]
    assert distance.max() <= 1 + 1e-9
    # A facet of a solid comes as near as its insphere: 0.577 of the radius in an octahedron.
    assert distance.min() > 0.57
    assert np.bincount(owner, minlength=len(balls.radii)).min() >= balls.vertices.shape[1]
    centres = cKDTree(balls.centres)
    for i, j in centres.query_pairs(2 * balls.radii.max()):
        assert np.linalg.norm(balls.centres[i] - balls.centres[j]) > balls.radii[i] + balls.radii[j]


def test_mesh_conforms(made):
    """Two tetrahedra share a face, or it lies on the box or on one ball and belongs to one."""
    _, _, mesh = made
    faces = Counter(face for tet in np.sort(mesh.tets).tolist() for face in itertools.combinations(tet, 3))
    assert max(faces.values()) == 2
    at_plane = np.stack([mesh.vertices == mesh.lower, mesh.vertices == mesh.upper], axis=1).reshape(-1, 6)
    for face, count in faces.items():
        vertices = list(face)
        owner = mesh.owner[vertices]
        on_one_ball = owner[0] >= 0 and (owner == owner[0]).all()
        assert (count == 1) == (on_one_ball or at_plane[vertices].all(axis=0).any())


def test_every_vertex_is_used_and_marked(made):
    _, box, mesh = made
    assert np.isin(np.arange(len(mesh.vertices)), mesh.tets).all()
    on_box = ((mesh.vertices == box.lower) | (mesh.vertices == box.upper)).any(axis=1)
    np.testing.assert_array_equal(mesh.boundary, on_box)
    assert (mesh.owner[mesh.boundary] == -1).all()
    np.testing.assert_array_equal([mesh.lower, mesh.upper], [box.lower, box.upper])
    assert (mesh.vertices.dtype, mesh.tets.dtype, mesh.owner.dtype) == (np.float64, np.int32, np.int32)


def test_meshers_agree_on_the_normals():
    """Is the fast mesher still FaCE? Here in small, in benchmarks/fidelity.py at length."""
    cup = shapes.torus(600)
    names = ("gmsh, octahedra", "gmsh, icosahedra", "tetgen, icosahedra", "tetwild")
    normals = {}
    for name in names:
        params = dataclasses.replace(CASES[name], angles="field", cage_spacing=0.0)
        normals[name] = estimate_normals(cup.points, params).normals
        assert ((normals[name] * cup.normals).sum(axis=1) > 0).all()
    for name in names:
        cosine = (normals[name] * normals["tetgen, icosahedra"]).sum(axis=1)
        # Measured on tori, spheres and boxes, two seeds each: 3.8 to 5.4 degrees.
        assert np.degrees(np.median(np.arccos(np.clip(cosine, -1, 1)))) < 8


def test_discretisation_of_the_paper():
    """Paper section 3.1: icosahedra, padded by 0.1 of the shortest side, tetrahedra below 0.001 of it."""
    plate = shapes.slab(300, thickness=0.1)
    face = FaCE(plate.points, Params.paper())
    mesh, balls = face.mesh, face.balls
    assert len(balls.radii) == 300
    assert balls.vertices.shape[1] == 12
    lower = (balls.centres - balls.radii[:, None]).min(axis=0)
    upper = (balls.centres + balls.radii[:, None]).max(axis=0)
    np.testing.assert_allclose(lower - mesh.lower, 0.1 * (upper - lower).min())
    np.testing.assert_allclose(mesh.upper - upper, 0.1 * (upper - lower).min())
    volume = tet_volumes(mesh.vertices, mesh.tets)
    assert volume.max() <= 0.001 * np.prod(mesh.upper - mesh.lower)
    corners = mesh.vertices[mesh.tets]
    edges = corners[:, 1:] - corners[:, :1]
    centre = np.linalg.solve(edges, 0.5 * (edges**2).sum(axis=2)[..., None])[..., 0]
    shortest = np.min(
        [np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i in range(4) for j in range(i)], axis=0
    )
    # TetGen gives the bound up where facets come close: measured 1.5 to 1.8 % of them (Delaunay: 11 to 30 %).
    assert np.mean(np.linalg.norm(centre, axis=1) / shortest > 1.415) < 0.04


@pytest.mark.parametrize("mesher", ["delaunay", "tetgen"])
def test_same_mesh_every_time(mesher):
    balls, spacing, box = caged(BALL.points)
    first, second = (build_mesh(balls, spacing, box, Params(mesher=mesher)) for _ in range(2))
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.tets, second.tets)
    np.testing.assert_array_equal(first.owner, second.owner)


def test_surface_turns_out_of_the_domain():
    for solid in SOLIDS:
        balls, _, box = caged(BALL.points[:20], solid)
        surface = boundary_surface(balls, box)
        a, b, c = (surface.vertices[column] for column in surface.faces.T)
        flux = np.einsum("ij,ij->i", np.cross(b, c), a) / 6
        # Divergence theorem: the box counts positive, the solids negative.
        assert flux[surface.owner < 0].sum() == pytest.approx(np.prod(box.upper - box.lower))
        assert flux[surface.owner >= 0].sum() == pytest.approx(-ball_volumes(balls).sum())


def test_needles_keep_their_volume():
    """Far vertex first, the volume of this tetrahedron is lost to rounding."""
    base = 1e-9 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    vertices = np.vstack([[[0.3, 0.4, 0.5]], base]) + 0.123
    exact = 1e-18 * 0.5 / 6
    turned, volumes = oriented(vertices, np.array([[0, 1, 2, 3], [0, 2, 1, 3]], dtype=np.int32), flat=1e-14)
    assert (turned[:, 0] != 0).all()
    volume = tet_volumes(vertices, turned)
    np.testing.assert_allclose(volumes, volume, rtol=1e-12)
    # The coordinates themselves are rounded to 1e-17, 1e-8 of the base's edges.
    np.testing.assert_allclose(volume, exact, rtol=1e-6)


def test_flat_tetrahedra_are_left_out():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1.0]])
    tets = np.array([[0, 1, 2, 3], [0, 1, 2, 4]], dtype=np.int32)
    assert len(oriented(vertices, tets, flat=1e-14)[0]) == 1
