"""What the meshers refuse, the gate around them, and the process in which the native ones run."""

import dataclasses
import logging
import os
import subprocess
import sys

import numpy as np
import pytest
from cages import BALL, caged

from face_plugin import MeshingError, MissingDependencyError, Params, estimate_normals
from face_plugin.faraday import domain
from face_plugin.faraday.meshers import delaunay, gate
from face_plugin.faraday.meshers.boundary import boundary_surface
from face_plugin.faraday.meshers.native import run_native
from face_plugin.faraday.meshers.select import build_mesh
from face_plugin.faraday.meshers.tetgen import tetgen_mesh

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
