"""One suite for the meshers, the gate around them, and the process in which the native ones run."""

import dataclasses
import itertools
import logging
import os
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
from scipy.spatial import cKDTree
from tet_meshes import tet_volumes

from face_plugin import FaCE, MeshingError, MissingDependencyError, Params, estimate_normals, shapes
from face_plugin.faraday import domain
from face_plugin.faraday.balls import SOLIDS, build_balls
from face_plugin.faraday.meshers import delaunay, gate
from face_plugin.faraday.meshers.boundary import ball_volumes, boundary_surface, oriented
from face_plugin.faraday.meshers.native import run_native
from face_plugin.faraday.meshers.select import build_mesh
from face_plugin.faraday.meshers.tetgen import tetgen_mesh
from face_plugin.geometry import local_spacing

BALL = shapes.sphere(150)
CASES = {
    "gmsh, octahedra": Params(mesher="delaunay"),
    "gmsh, icosahedra": Params(mesher="delaunay", solid="icosahedron"),
    "scipy": Params(mesher="delaunay"),
    "tetgen, icosahedra": Params.paper(),
    "tetgen, octahedra": Params(mesher="tetgen"),
    "tetwild": Params(mesher="tetwild"),
}


def caged(points, solid="octahedron", radius=0.45, padding=0.1):
    points = points / np.linalg.norm(np.ptp(points, axis=0))
    balls = build_balls(points, np.arange(len(points)), radius=radius, solid=solid)
    return balls, local_spacing(points), domain.padded_box(balls, padding)


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


LATTICE = np.stack(np.meshgrid(*3 * [np.arange(6.0)]), axis=-1).reshape(-1, 3)
NEAR = np.vstack([BALL.points, BALL.points[:50] + 1e-9 * np.random.default_rng(0).normal(size=(50, 3))])
HARD = {
    "near-coincident points": (NEAR, {}),
    "balls that touch after rounding": (LATTICE, {"ball_radius": float(np.nextafter(0.5, 0))}),
    "balls that touch the box": (LATTICE, {"padding": 1e-17, "least_side": 0.0}),
    "spacing ratio 1e6": (np.vstack([BALL.points, 1e-6 * BALL.points + [1.5, 0, 0]]), {}),
    "10,000 exact duplicates": (np.vstack([BALL.points, np.repeat(BALL.points[:1], 10_000, axis=0)]), {}),
}


# What a mesher does not manage: facets that touch, near-coincident points, which leave balls of 1e-9 of the
# box, and for fTetWild balls of 1e-6 as well.
REFUSED = {
    "balls that touch after rounding": ("tetgen", "tetwild"),
    "near-coincident points": ("tetgen", "tetwild"),
    "spacing ratio 1e6": ("tetwild",),
}


@pytest.mark.parametrize("mesher", ["auto", "delaunay", "tetgen", "tetwild"])
@pytest.mark.parametrize("name", HARD)
def test_hard_input_gives_normals_or_says_what_to_try(name, mesher):
    """A crash of a native library would end this process, and with it the tests."""
    points, settings = HARD[name]
    params = Params(mesher=mesher, cage_spacing=0.0, angles="field", **settings)
    if mesher in REFUSED.get(name, ()):
        with pytest.raises(MeshingError, match="try "):
            estimate_normals(points, params)
        return
    normals = estimate_normals(points, params).normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    if name == "10,000 exact duplicates":
        np.testing.assert_array_equal(normals[len(BALL) :], np.tile(normals[0], (10_000, 1)))


def test_gate_refuses_what_cannot_be_meshed():
    limits = {"smallest": 1e-9, "gap": 1e-9, "clearance": 1e-9}
    balls, spacing, box = caged(BALL.points)
    gate.check_balls(balls, spacing, box, **limits)
    outside = domain.Box(box.lower, box.upper - 0.3 * (box.upper - box.lower))
    endless = domain.Box(box.lower, box.upper * np.array([1, 1, 1e300]))
    tiny = dataclasses.replace(balls, radii=np.where(np.arange(150) == 7, 1e-12, balls.radii))
    vertices = balls.vertices.copy()
    vertices[3, 2, 1] = np.nan
    broken = dataclasses.replace(balls, vertices=vertices)
    wide = caged(BALL.points, radius=0.7)[0]
    one_wide = dataclasses.replace(balls, radii=np.where(np.arange(150) == 9, 1.3, 1.0) * balls.radii)
    for bad, where, message in [
        (balls, outside, "comes within -.* of the box .*padding"),
        (balls, endless, "the box must have sides within .*padding"),
        (tiny, box, "1 balls are too small to mesh.*cage_spacing"),
        (broken, box, "finite"),
        (wide, box, "touches another one.*ball_radius"),
        (one_wide, box, "touches another one.*ball_radius"),
    ]:
        with pytest.raises(MeshingError, match=message):
            gate.check_balls(bad, spacing, where, **limits)
    # A ball that reaches over half the way to its neighbour touches nothing where the neighbour is small.
    small = np.where(np.arange(150) == 9, 1.0, 0.5)
    gate.check_balls(dataclasses.replace(one_wide, radii=one_wide.radii * small), spacing, box, **limits)


@pytest.mark.parametrize("mesher", ["auto", "delaunay", "tetgen", "tetwild"])
def test_point_on_the_box_is_refused(mesher):
    balls, spacing, box = caged(BALL.points)
    through = domain.Box(box.lower, np.array([balls.centres[:, 0].max(), *box.upper[1:]]))
    with pytest.raises(MeshingError, match=r"a ball comes within -.* of the box .*try a larger Params.padding"):
        build_mesh(balls, spacing, through, Params(mesher=mesher))


def test_gate_refuses_meshes_that_are_wrong():
    balls, spacing, box = caged(BALL.points)
    mesh = build_mesh(balls, spacing, box, Params())
    gate.check_mesh(mesh, balls, box, advice="")
    inverted = mesh.tets.copy()
    inverted[5] = inverted[5, [1, 0, 2, 3]]
    disowned = np.where(mesh.owner == 7, -1, mesh.owner)
    for change, message in [
        ({"tets": mesh.tets[1:]}, "fill 0.99"),
        ({"tets": mesh.tets[:0]}, "flat or inverted"),
        ({"tets": inverted}, "1 of .* tetrahedra are flat or inverted"),
        ({"vertices": np.vstack([mesh.vertices, [[0, 0, 0]]])}, "1 of .* vertices belong to no tetrahedron"),
        ({"owner": disowned}, "1 of 150 balls were lost"),
    ]:
        with pytest.raises(MeshingError, match=f"{message}.*; try this"):
            gate.check_mesh(dataclasses.replace(mesh, **change), balls, box, advice="try this")


@pytest.mark.parametrize("mesher", ["auto", "delaunay", "tetgen", "tetwild"])
def test_memory_is_bounded(mesher):
    balls, spacing, box = caged(BALL.points)
    with pytest.raises(MeshingError, match=r"GB, more than the allowed 0.001; try .*max_memory"):
        build_mesh(balls, spacing, box, Params(mesher=mesher), memory=1e6)


def test_memory_of_free_vertices_is_bounded():
    """The finest cells of this octree would be a billion."""
    balls, spacing, box = caged(BALL.points)
    with pytest.raises(MeshingError, match=r"more than .* free vertices, .*try a larger Params.finest"):
        build_mesh(balls, spacing, box, Params(mesher="delaunay", finest=0.01, grading=0.01), memory=0.1e9)


def test_auto_goes_on_to_the_next_mesher_and_says_so(monkeypatch, caplog):
    # Displaced by 1 % of the box, the vertices that gmsh sees have other Delaunay tetrahedra than ours.
    monkeypatch.setattr(delaunay, "NUDGE", 1e-2)
    balls, spacing, box = caged(BALL.points)
    with pytest.raises(MeshingError, match=r"gmsh: .*balls"):
        build_mesh(balls, spacing, box, Params(mesher="delaunay"))
    assert not caplog.records
    with caplog.at_level(logging.WARNING, logger="face_plugin"):
        mesh = build_mesh(balls, spacing, box, Params())
    gate.check_mesh(mesh, balls, box, advice="")
    text = caplog.text
    assert "the mesher gmsh failed" in text
    assert "made by scipy instead" in text
    # SciPy refused too: fTetWild is left.
    monkeypatch.setattr(delaunay, "BALL_TOLERANCE", -1.0)
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="face_plugin"):
        mesh = build_mesh(balls, spacing, box, Params())
    gate.check_mesh(mesh, balls, box, advice="")
    assert "made by tetwild instead" in caplog.text
    # Neither: all reasons are given.
    monkeypatch.setitem(sys.modules, "pytetwild", None)
    with pytest.raises(MeshingError, match=r"gmsh: .*scipy: .*tetwild: pytetwild is needed here"):
        build_mesh(balls, spacing, box, Params())


def test_scipy_serves_where_gmsh_cannot_be_loaded(monkeypatch, caplog):
    balls, spacing, box = caged(BALL.points)
    monkeypatch.setitem(sys.modules, "gmsh", None)
    delaunay._gmsh.cache_clear()
    try:
        with caplog.at_level(logging.INFO, logger="face_plugin"):
            mesh = build_mesh(balls, spacing, box, Params(mesher="delaunay"))
    finally:
        delaunay._gmsh.cache_clear()
    gate.check_mesh(mesh, balls, box, advice="")
    # A package that nobody needs is no warning.
    told = [record for record in caplog.records if "gmsh" in record.getMessage()]
    assert [record.levelno for record in told] == [logging.INFO]


@pytest.mark.parametrize(("mesher", "package"), [("tetgen", "tetgen"), ("tetwild", "pytetwild")])
def test_missing_package_is_named_with_its_extra(mesher, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingDependencyError, match=rf"{package} .*face-plugin\[{mesher}\]"):
        build_mesh(*caged(BALL.points), Params(mesher=mesher))


def test_crash_of_a_native_library_is_an_exception():
    balls, _, box = caged(BALL.points)
    surface = boundary_surface(balls, box)
    data = {"vertices": surface.vertices, "faces": surface.faces, "markers": surface.owner + np.int32(2)}
    # Without the switch p TetGen meshes points only; with Q it ends with a segmentation fault.
    crashing = {**data, "holes": balls.centres, "switches": np.array("Q")}
    with pytest.raises(MeshingError, match=r"tetgen crashed \(signal 11\); try something"):
        run_native("tetgen", crashing, memory=2e9, advice="try something")


def test_native_library_cannot_take_more_memory_than_allowed():
    """The limit itself, behind the estimate: a volume bound that asks for a hundred million tetrahedra."""
    balls, _, box = caged(BALL.points)
    surface = boundary_surface(balls, box)
    data = {"vertices": surface.vertices, "faces": surface.faces, "markers": surface.owner + np.int32(2)}
    data = {**data, "holes": balls.centres, "switches": np.array("pq1.414a1e-9Q")}
    if sys.platform != "linux":
        pytest.skip("address space is limited on Linux only")
    with pytest.raises(MeshingError, match=r"tetgen (crashed|failed).*; try something"):
        run_native("tetgen", data, memory=1e8, advice="try something")


def test_intersecting_facets_are_refused_by_tetgen():
    balls, _, box = caged(BALL.points, "icosahedron", radius=0.8)
    with pytest.raises(MeshingError, match=r"tetgen failed .*try Params.mesher='delaunay'"):
        tetgen_mesh(balls, box, memory=2e9)


def test_native_meshers_work_from_a_script_without_a_guard(tmp_path):
    """The child must not run the script again, import what happens to lie beside it, or leave files there."""
    (tmp_path / "tetwild.py").write_text("raise SystemExit('imported by accident')\n")
    script = tmp_path / "script.py"
    script.write_text(
        "from face_plugin import Params, estimate_normals\n"
        "from face_plugin.shapes import sphere\n"
        "print('started')\n"
        "for mesher in ('tetgen', 'tetwild'):\n"
        "    print(estimate_normals(sphere(60).points, Params(mesher=mesher)).normals.shape)\n"
    )
    ran = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        env=dict(os.environ),
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines() == ["started", "(60, 3)", "(60, 3)"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["script.py", "tetwild.py"]


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
