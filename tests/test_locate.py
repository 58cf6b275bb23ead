import numpy as np
import pytest
from tet_meshes import grid_mesh

from face_plugin import FaCE, Params, shapes
from face_plugin.faraday.gradient import ball_means
from face_plugin.faraday.locate import Locator
from face_plugin.faraday.meshers import CageMesh


def in_the_box(mesh, count, seed=0):
    return np.random.default_rng(seed).uniform(mesh.lower, mesh.upper, (count, 3))


@pytest.fixture(scope="module")
def locator(demo_face):
    return Locator(demo_face.mesh)


def test_linear_values_are_reproduced_outside_the_balls(demo_face, locator):
    mesh = demo_face.mesh
    points = in_the_box(mesh, 5000)
    outside = locator.find(points)[0] < len(mesh.tets)
    slope = np.array([[1.0, 5.0], [-2.0, 0.0], [0.5, 1.0]])
    found = locator.interpolate(points, mesh.vertices @ slope + [3.0, 4.0])
    np.testing.assert_allclose(found[outside], (points @ slope + [3.0, 4.0])[outside], atol=1e-12)
    # Near the surface, where the balls are, some positions fall into one.
    assert 0 < np.count_nonzero(~outside) < 2500


def test_tetrahedron_contains_its_position(demo_face, locator):
    mesh = demo_face.mesh
    points = in_the_box(mesh, 2000)
    tet, weights = locator.find(points)
    assert (tet >= 0).all()
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    centres = np.array([mesh.vertices[mesh.owner == k].mean(axis=0) for k in range(mesh.owner.max() + 1)])
    corners = np.vstack([mesh.vertices, centres])[locator.tets[tet]]
    np.testing.assert_allclose(np.einsum("kc,kcd->kd", weights, corners), points, atol=1e-13)


def test_vertices_and_balls_have_their_own_values(demo_face, locator):
    mesh, values = demo_face.mesh, demo_face.vertex_strength
    free = mesh.owner < 0
    np.testing.assert_allclose(locator.interpolate(mesh.vertices[free], values), values[free], atol=1e-10)
    means = ball_means(mesh, values)
    np.testing.assert_allclose(locator.interpolate(demo_face.balls.centres, values), means, rtol=1e-12)
    # Constant inside a ball: half way to its vertices it is the same.
    half_way = 0.5 * (demo_face.balls.centres + demo_face.balls.vertices[:, 0])
    np.testing.assert_allclose(locator.interpolate(half_way, values), means, rtol=1e-12)


def test_outside_of_the_box(demo_face, locator):
    mesh = demo_face.mesh
    points = np.array([mesh.lower - 1e-9, mesh.upper + 1.0, [0.0, 0.0, 1e9]])
    tet, weights = locator.find(points)
    assert (tet == -1).all()
    assert (weights == 0).all()
    assert np.isnan(locator.interpolate(points, mesh.vertices)).all()
    np.testing.assert_array_equal(locator.interpolate(points, mesh.vertices[:, 0], outside=1.0), 1.0)


def test_box_itself_belongs_to_the_mesh(demo_face, locator):
    mesh = demo_face.mesh
    points = in_the_box(mesh, 300)
    points[::3, 0], points[1::3, 1], points[2::3, 2] = mesh.lower[0], mesh.upper[1], mesh.lower[2]
    corners = np.stack(np.meshgrid(*np.column_stack([mesh.lower, mesh.upper])), axis=-1).reshape(-1, 3)
    points = np.vstack([points, corners])
    np.testing.assert_allclose(locator.interpolate(points, mesh.vertices), points, atol=1e-12)


def test_shapes_of_values(demo_face, locator):
    mesh = demo_face.mesh
    for query in (in_the_box(mesh, 7), np.empty((0, 3))):
        assert locator.interpolate(query, demo_face.vertex_strength).shape == (len(query),)
        assert locator.interpolate(query, demo_face.potential()).shape == (len(query), 3)


def test_potential_is_the_conductors_inside_every_ball(demo_face, locator):
    mesh, potential = demo_face.mesh, demo_face.potential()
    at_cage = potential[np.flatnonzero(mesh.owner >= 0)[0]]
    found = locator.interpolate(demo_face.balls.centres, potential)
    np.testing.assert_allclose(found, np.broadcast_to(at_cage, found.shape), atol=1e-14)


def test_cracks_of_missing_tetrahedra_are_bridged():
    vertices, tets = grid_mesh(6)
    boundary = (np.abs(vertices) == 1).any(axis=1)
    rng = np.random.default_rng(0)
    kept = tets[rng.random(len(tets)) > 0.1]
    owner = np.full(len(vertices), -1, dtype=np.int32)
    mesh = CageMesh(vertices, kept, owner, boundary, vertices.min(axis=0), vertices.max(axis=0))
    points = in_the_box(mesh, 2000)
    found = Locator(mesh).interpolate(points, vertices)
    error = np.linalg.norm(found - points, axis=1)
    # Positions in a tetrahedron are exact, those in a hole take the next one's nearest value: within a cell.
    assert np.count_nonzero(error < 1e-12) / 2000 == pytest.approx(0.9, abs=0.03)
    assert error.max() < 1 / 3


@pytest.mark.parametrize(
    ("points", "spacing"),
    [
        (np.vstack([shapes.sphere(200).points, shapes.sphere(200).points + 1e-9 * np.ones(3)]), 0.0),
        (np.vstack([shapes.sphere(200).points, 1e-6 * shapes.sphere(200).points + [3, 0, 0]]), None),
        (shapes.sphere(100).points * [1e3, 1, 1], None),
    ],
    ids=["twins", "two densities", "needle"],
)
def test_strongly_graded_meshes(points, spacing):
    mesh = FaCE(points, Params(cage_spacing=spacing)).mesh
    locator = Locator(mesh)
    query = np.vstack([in_the_box(mesh, 3000), mesh.vertices[mesh.owner < 0][:2000]])
    outside = locator.find(query)[0] < len(mesh.tets)
    found = locator.interpolate(query, mesh.vertices)
    np.testing.assert_allclose(found[outside], query[outside], atol=1e-9)


def test_strength_of_the_solver(demo, demo_face):
    result = demo_face.result()
    with_ball = np.isin(demo_face.cloud.rows, demo_face.balls.points)
    found = demo_face.strength(demo.points)
    np.testing.assert_allclose(found[with_ball], result.strength[with_ball], rtol=1e-9)
    far = np.array([[100.0, 0, 0], [0, -50.0, 0]])
    np.testing.assert_array_equal(demo_face.strength(far), 1.0)
    # Shielded in the middle, unshielded near the box.
    middle = demo.points[demo.interior].mean(axis=0, keepdims=True)
    assert demo_face.strength(middle)[0] < 1e-6
    corner = demo_face.frame.from_unit(demo_face.mesh.lower[None])
    assert 0.5 < demo_face.strength(corner)[0] < 2
    with pytest.raises(ValueError, match="query must have the shape"):
        demo_face.strength([1.0, 2.0, 3.0])
