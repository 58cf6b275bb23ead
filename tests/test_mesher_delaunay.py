import threading

import numpy as np
import pytest
from scipy.spatial import cKDTree
from tet_meshes import tet_volumes

from face_plugin import FaCE, MeshingError, Params, shapes
from face_plugin.faraday import domain
from face_plugin.faraday.balls import SOLIDS, build_balls
from face_plugin.faraday.meshers.delaunay import delaunay_mesh, gmsh_loads, tetrahedralize
from face_plugin.geometry import local_spacing

RNG = np.random.default_rng(0)
LATTICE = np.stack(np.meshgrid(*3 * [np.arange(6.0)]), axis=-1).reshape(-1, 3)
CLOUDS = {
    "torus": shapes.torus(300).points,
    "random": RNG.random((300, 3)),
    "lattice": LATTICE,
    "shell of a lattice": LATTICE[((LATTICE == 0) | (LATTICE == 5)).any(axis=1)],
    "plane": RNG.random((200, 3)) * [1, 1, 0],
    "plane lattice": LATTICE[LATTICE[:, 2] == 0],
    "line and one": np.vstack([np.linspace([0, 0, 0], [1, 0, 0], 60), [[0.5, 0.1, 0.0]]]),
    "circle": np.column_stack([np.cos(np.arange(50) * np.pi / 25), np.sin(np.arange(50) * np.pi / 25), np.zeros(50)]),
    "two densities": np.vstack([shapes.sphere(200).points, 1e-6 * shapes.sphere(200).points + [3, 0, 0]]),
    "geometric": np.geomspace(1e-6, 1, 200)[:, None] * RNG.normal(size=(200, 3)),
    "twins": np.vstack([shapes.sphere(200).points, shapes.sphere(200).points + 1e-7 * RNG.normal(size=(200, 3))]),
    "needle": shapes.sphere(100).points * [1e3, 1, 1],
    "four": np.vstack([np.zeros(3), np.eye(3)]),
    "five": np.vstack([np.zeros(3), np.eye(3), [[0.3, 0.3, -0.7]]]),
}


def meshed(points, solid="octahedron", library=None):
    balls = build_balls(points / np.ptp(points, axis=0).max(), np.arange(len(points)), solid=solid)
    box = domain.padded_box(balls, 0.1)
    filling = domain.fill(balls, local_spacing(balls.centres), box, grading=0.8, finest=1.5, seed=0)
    return balls, box, delaunay_mesh(balls, filling, box, library)


@pytest.mark.parametrize("solid", ["octahedron", "icosahedron"])
@pytest.mark.parametrize("name", CLOUDS)
def test_mesh_fills_the_box_without_the_balls(name, solid):
    balls, box, mesh = meshed(CLOUDS[name], solid)
    count, corners = len(balls.radii), balls.vertices.shape[1]
    np.testing.assert_array_equal(mesh.vertices[: count * corners], balls.vertices.reshape(-1, 3))
    np.testing.assert_array_equal(mesh.owner[: count * corners], np.repeat(np.arange(count), corners))
    assert (mesh.owner[count * corners :] == -1).all()
    np.testing.assert_array_equal(
        mesh.boundary, ((mesh.vertices == box.lower) | (mesh.vertices == box.upper)).any(axis=1)
    )
    np.testing.assert_array_equal([mesh.lower, mesh.upper], [box.lower, box.upper])
    volume = tet_volumes(mesh.vertices, mesh.tets)
    assert volume.min() > 0
    solid_volume = {"octahedron": 4 / 3, "icosahedron": 2.536150}[solid]
    # Nothing is missing and nothing overlaps. What is flat up to rounding is left out: measured up to 6e-8.
    free = np.prod(box.upper - box.lower) - solid_volume * (balls.radii**3).sum()
    assert volume.sum() == pytest.approx(free, rel=1e-6)
    owner = mesh.owner[mesh.tets]
    assert not ((owner == owner[:, :1]).all(axis=1) & (owner[:, 0] >= 0)).any()
    assert np.isin(np.arange(len(mesh.vertices)), mesh.tets).all()


def test_tetrahedra_are_delaunay():
    points = RNG.random((60, 3))
    tets = tetrahedralize(points)
    corner = points[tets[:, 0]]
    edges = points[tets[:, 1:]] - corner[:, None]
    centre = corner + np.linalg.solve(edges, 0.5 * (edges**2).sum(axis=2)[..., None])[..., 0]
    radius = np.linalg.norm(centre - corner, axis=1)
    assert (cKDTree(points).query(centre)[0] >= radius * (1 - 1e-9)).all()


def test_gmsh_and_scipy_agree_on_random_points():
    points = RNG.random((500, 3))
    ours, theirs = (
        {tuple(sorted(t)) for t in tetrahedralize(points, library).tolist()} for library in ("gmsh", "scipy")
    )
    assert ours == theirs


def test_repeated_calls_give_the_same_tetrahedra():
    """gmsh breaks ties with the C library's random numbers, unless it is kept from it."""
    points = np.vstack([SOLIDS["octahedron"] + centre for centre in 3 * LATTICE[:40]])
    first = tetrahedralize(points)
    for _ in range(3):
        np.testing.assert_array_equal(tetrahedralize(points), first)


def test_meshes_from_several_threads_at_once():
    expected = tetrahedralize(RNG.random((2000, 3)))
    clouds = [np.random.default_rng(k).random((2000, 3)) for k in range(4)]
    expected = [tetrahedralize(cloud) for cloud in clouds]
    found = {}
    threads = [threading.Thread(target=lambda k=k: found.update({k: tetrahedralize(clouds[k])})) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k in range(4):
        np.testing.assert_array_equal(found[k], expected[k])


def test_state_of_gmsh_is_left_as_it_was():
    assert gmsh_loads()
    import gmsh

    tetrahedralize(RNG.random((20, 3)))
    gmsh.model.add("the user's")
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.RandomFactor3D", 1e-9)
    tetrahedralize(RNG.random((20, 3)))
    assert gmsh.model.getCurrent() == "the user's"
    assert len(gmsh.model.getEntities(3)) == 1
    assert gmsh.option.getNumber("Mesh.RandomFactor3D") == 1e-9
    gmsh.model.remove()


def test_balls_that_overlap_are_refused():
    points = shapes.sphere(50).points
    balls = build_balls(points, np.arange(50), radius=0.9)
    box = domain.padded_box(balls, 0.1)
    filling = domain.fill(balls, local_spacing(points), box, grading=0.8, finest=1.5, seed=0)
    with pytest.raises(MeshingError, match="cut through"):
        delaunay_mesh(balls, filling, box)


@pytest.mark.parametrize("name", CLOUDS)
def test_whole_method_on_degenerate_clouds(name):
    """Nothing crashes or hangs, whether near-duplicates carry a ball or not; what comes out is a number."""
    points = CLOUDS[name]
    for spacing in (None, 0.0):
        face = FaCE(points, Params(cage_spacing=spacing))
        normals = face.normals()
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
        assert np.isfinite(face.vertex_strength).all()
        strength = face.strength(points)
        assert np.isfinite(strength).all()
        assert (strength >= 0).all()
