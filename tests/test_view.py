from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import polyscope
import polyscope.imgui as imgui
import pytest
from PIL import Image

from face_plugin import shapes
from face_plugin.app.cli import main
from face_plugin.app.viewer import session as session_module
from face_plugin.app.viewer.session import Plane, Session
from face_plugin.app.viewer.window import Viewer
from face_plugin.io import read_cloud
from face_plugin.sculpt import SculptFile
from face_plugin.surface import poisson_reconstruction

SIZE = (900, 700)


@pytest.fixture(scope="module")
def solved():
    return Session(shapes.cup(1500, depth=1.5).points)


@pytest.fixture
def session(solved):
    """A session of its own on the cage that all tests share."""
    solved.mode, solved.plane, solved.alpha = "look", Plane(), 0.01
    while solved.face.edits:
        solved.undo()
    return solved


class Spy:
    """The real imgui, which also remembers where each widget was drawn."""

    def __init__(self):
        self.boxes = {}

    def __getattr__(self, name):
        real = getattr(imgui, name)
        if name not in ("Button", "Checkbox", "RadioButton", "SliderFloat", "Combo", "InputText"):
            return real

        def drawn(label, *args):
            out = real(label, *args)
            self.boxes[label] = *imgui.GetItemRectMin(), *imgui.GetItemRectMax()
            return out

        return drawn


class Hand:
    """A viewer without a window, and a mouse for it: events that go through imgui as a person's do."""

    def __init__(self, session, tmp_path):
        files = {"sculpt_file": tmp_path / "edits.json", "mesh_file": tmp_path / "mesh.ply"}
        files["viewpoints_file"] = tmp_path / "views.csv"
        self.viewer = Viewer(session, headless=True, size=SIZE, **files)
        self.viewer._gui = self.spy = Spy()
        # Peeling layer after layer takes a software renderer long, and changes no click.
        polyscope.set_transparency_mode("simple")
        # Two tests may click on one place within the time of a double click.
        imgui.GetIO().MouseDoubleClickTime = 0.0
        self.move(2, 2)

    def move(self, x, y):
        imgui.GetIO().AddMousePosEvent(x, y)
        self.frames(1)

    def button(self, down):
        imgui.GetIO().AddMouseButtonEvent(0, down)
        self.frames(1)

    def frames(self, count):
        for _ in range(count):
            polyscope.frame_tick()

    def click(self, x, y):
        self.move(x, y)
        self.button(True)
        self.button(False)

    def press(self, label, across=0.1):
        """Click on a widget, at a fraction of its width; that of a slider has its label at the right end."""
        left, top, right, bottom = self.spy.boxes[label]
        self.click(left + across * (right - left), 0.5 * (top + bottom))

    def picture(self, path):
        polyscope.set_transparency_mode("pretty")
        self.viewer.screenshot(path)
        polyscope.set_transparency_mode("simple")
        return np.asarray(Image.open(path).convert("RGB")).astype(float)


@pytest.fixture
def hand(session, tmp_path):
    return Hand(session, tmp_path)


def yellow(picture):
    """Number of pixels that may belong to a charge."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((red > blue + 80) & (green > blue + 50)).sum())


def green(picture):
    """Number of pixels that may belong to a cage point."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((green > 1.4 * red) & (green > 1.2 * blue) & (green > 60)).sum())


def look(camera, target):
    """Put the camera somewhere; not straight above, for the turntable has no up there."""
    polyscope.look_at_dir(camera, target, (0.0, 0.0, 1.0))


def look_into_the_mug():
    look((1.2, -1.2, 4.2), (0.0, 0.0, 0.9))


def test_looking_changes_nothing(session):
    face = session.face
    assert session.click([0.0, 0.0, 0.5]) == ()
    session.clear()
    session.undo()
    session.redo()
    assert session.face is face


def test_carve_shield_undo_redo_clear(session):
    bare = session.face
    session.mode = "carve"
    (charge,) = session.click([0.0, 0.0, 0.4])
    carved = session.face
    session.mode = "shield"
    (cage,) = session.click([0.0, 0.0, 1.2])
    both = session.face
    assert [edit.kind for edit in both.edits] == ["charge", "cage"]
    session.clear()
    assert session.face.edits == ()
    session.undo()
    assert session.face is both
    session.undo()
    assert session.face is carved
    assert carved.edits == (charge,)
    session.redo()
    assert session.face.edits == (charge, cage)
    session.undo()
    session.undo()
    session.undo()
    assert session.face is bare
    session.redo()
    # An edit after an undo drops what was undone.
    session.click([0.2, 0.0, 1.3])
    after = session.face
    session.redo()
    assert session.face is after


def test_only_so_many_states_are_kept(session, monkeypatch):
    monkeypatch.setattr(session_module, "LONGEST_HISTORY", 3)
    own = Session(shapes.sphere(200).points)
    own.mode = "carve"
    for _ in range(4):
        own.click([0.0, 0.0, 0.0])
    for _ in range(9):
        own.undo()
    assert len(own.face.edits) == 2


def test_a_refused_click_changes_nothing(session):
    face = session.face
    session.mode = "carve"
    with pytest.raises(ValueError, match="on or outside the box"):
        session.click([0.0, 0.0, 50.0])
    assert session.face is face


def test_a_click_on_a_ball_goes_beside_it(session):
    face = session.face
    session.mode = "carve"
    # The point on the rim that is highest up: nothing is in the way above it.
    centres = face.frame.from_unit(face.balls.centres)
    top = centres[centres[:, 2].argmax()]
    with pytest.raises(ValueError, match="inside the conducting ball"):
        session.click(top)
    (edit,) = session.click(top, [0.0, 0.0, 1.0])
    assert edit.position[2] > top[2]


def test_alpha_moves_the_proxy_and_the_interior(session):
    volumes, counts = [], []
    for alpha in (0.001, 0.01, 0.1):
        session.alpha = alpha
        vertices, faces = session.proxy()
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        volumes.append(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
        counts.append(session.interior().sum())
        np.testing.assert_array_equal(session.interior(), session.face.interior(alpha))
    # Below a higher threshold lies more.
    assert volumes[0] < volumes[1] < volumes[2]
    assert counts[0] <= counts[1] <= counts[2]
    for alpha in (0.0, 1.0, np.nan):
        with pytest.raises(ValueError, match="alpha"):
            session.alpha = alpha
    assert session.alpha == 0.1


def test_automatic_is_what_face_mesh_does(session):
    assert not session.automatic  # alpha was set
    by_alpha = session.interior()
    session.automatic = True
    np.testing.assert_array_equal(session.interior(), session.face.interior("auto"))
    session.automatic = False
    np.testing.assert_array_equal(session.interior(), by_alpha)
    assert Session(shapes.sphere(200).points).automatic


def test_the_surface_is_of_refined_normals(session):
    face = session.face
    assert face.params.angles == "field"
    refined = face.with_angles("refined")
    assert not np.array_equal(refined.normals(), face.normals())
    kept = ~session.interior()
    vertices, _, _ = poisson_reconstruction(session.points[kept], refined.normals()[kept], depth=8)
    np.testing.assert_allclose(session.surface()[0], vertices, atol=1e-6)


def test_the_proxy_is_where_the_field_is_alpha(session):
    session.alpha = 0.05
    vertices, _ = session.proxy()
    # Interpolation along an edge and in a tetrahedron agree, but for balls, inside which `strength` is their
    # mean.
    outside = ~np.isclose(session.face.strength(vertices), 0.05, rtol=1e-6)
    assert outside.mean() < 0.3


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_field_is_cut_where_the_plane_says(session, axis):
    session.plane = Plane(axis, 0.25)
    vertices, quads, strength = session.cut(16)
    points = session.points
    low, high = points.min(axis=0), points.max(axis=0)
    np.testing.assert_allclose(vertices[:, axis], low[axis] + 0.25 * (high - low)[axis])
    others = np.arange(3) != axis
    assert (vertices.min(axis=0) < low)[others].all()
    assert (vertices.max(axis=0) > high)[others].all()
    np.testing.assert_array_equal(strength, session.face.strength(vertices))
    assert len(vertices) == 256
    # Each quad is one cell of the grid.
    assert len(np.unique(np.sort(quads, axis=1), axis=0)) == 15 * 15
    edges = np.diff(vertices[quads[:, [0, 1, 2, 3, 0]]], axis=1)
    np.testing.assert_allclose(np.linalg.norm(edges, axis=2), np.linalg.norm(edges[0], axis=1)[None].repeat(225, 0))


def test_what_is_saved_can_be_used(session, tmp_path):
    session.mode = "carve"
    session.click([0.0, 0.0, 0.4])
    session.save_sculpt(tmp_path / "edits.json")
    again = Session(session.points, sculpt=tmp_path / "edits.json")
    np.testing.assert_array_equal(again.face.vertex_strength, session.face.vertex_strength)
    session.save_mesh(tmp_path / "mesh.ply")
    assert len(read_cloud(tmp_path / "mesh.ply")) == len(session.surface()[0])
    with pytest.raises(ValueError, match=r"allowed are \.json"):
        session.save_sculpt(tmp_path / "edits.txt")
    with pytest.raises(ValueError, match="allowed are"):
        session.save_mesh(tmp_path / "mesh.gif")


def test_a_bad_sculpt_file_is_said_before_the_cage_is_solved(tmp_path):
    stages = []
    (tmp_path / "edits.json").write_text("{}")
    with pytest.raises(ValueError, match="the field 'version' is missing"):
        Session(shapes.sphere(200).points, sculpt=tmp_path / "edits.json", progress=lambda *a: stages.append(a))
    assert stages == []


def test_a_frame_shows_the_points_and_their_sides(hand, tmp_path):
    picture = hand.picture(tmp_path / "frame.png")
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    drawn = np.ptp(picture, axis=2) > 20
    # The mug fills the height of the window; its ground is white.
    assert drawn.any(axis=1).mean() > 0.5
    assert not drawn[:, :50].any()
    assert yellow(picture) + green(picture) == 0
    assert polyscope.get_point_cloud("points").n_points() == 1500
    assert hand.viewer.session.face.edits == ()


def test_the_points_fill_the_window(hand, session, tmp_path):
    """Whatever their shape and the axis that is up, and none is cut off."""
    for up in "xyz":
        viewer = Viewer(session, headless=True, size=SIZE, up=up)
        viewer.screenshot(tmp_path / "frame.png")
        drawn = np.ptp(np.asarray(Image.open(tmp_path / "frame.png").convert("RGB")).astype(float), axis=2) > 20
        rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
        assert max(np.ptp(rows) / SIZE[1], np.ptp(columns) / SIZE[0]) > 0.7
        assert rows[0] > 0
        assert rows[-1] < SIZE[1] - 1
        assert columns[0] > 0
        assert columns[-1] < SIZE[0] - 1


@pytest.mark.slow
def test_cutting_it_open_shows_a_charge_inside(hand, session, tmp_path):
    session.mode = "carve"
    session.click([0.0, 0.0, 0.75])
    closed = hand.picture(tmp_path / "closed.png")
    hand.press("cut open", across=0.05)
    opened = hand.picture(tmp_path / "opened.png")
    assert hand.viewer.picture.open
    assert polyscope.get_surface_mesh("field").is_enabled()
    assert yellow(opened) > yellow(closed) + 30
    hand.press("cut open", across=0.05)
    assert not hand.viewer.picture.open
    viewer = Viewer(session, headless=True, size=SIZE, cut="x")
    assert (viewer.picture.open, session.plane.axis) == (True, 0)


@pytest.mark.slow
def test_carving_by_the_mouse(hand, tmp_path):
    viewer, session = hand.viewer, hand.viewer.session
    before = ((session.face.normals() * session.points).sum(axis=1)).copy()
    look_into_the_mug()
    empty = hand.picture(tmp_path / "before.png")
    middle = np.array(SIZE) / 2
    hand.click(*middle)
    assert session.face.edits == ()  # the mode is "look"
    hand.press("carve")
    assert session.mode == "carve"
    hand.move(*middle)
    hand.button(True)
    hand.move(*(middle + 60))
    hand.button(False)
    assert session.face.edits == ()  # a drag turns the view
    look_into_the_mug()
    hand.click(*middle)
    (edit,) = session.face.edits
    assert edit.kind == "charge"
    # It is in the mug, near its axis, and outside the proxy that was clicked on.
    assert np.hypot(*edit.places[0][:2]) < 0.45
    assert -0.1 < edit.places[0][2] < 1.5
    assert viewer.message.startswith("charge at (")
    carved = hand.picture(tmp_path / "after.png")
    assert yellow(carved) > yellow(empty) + 30
    assert not np.array_equal((session.face.normals() * session.points).sum(axis=1), before)
    hand.press("undo")
    assert session.face.edits == ()
    assert not polyscope.has_point_cloud("charges")
    np.testing.assert_array_equal(hand.picture(tmp_path / "undone.png"), empty)
    hand.press("redo")
    assert session.face.edits == (edit,)
    hand.press("clear")
    assert session.face.edits == ()


def test_a_double_click_is_one_edit(hand):
    session = hand.viewer.session
    session.mode = "carve"
    look_into_the_mug()
    hand.click(5, SIZE[1] - 5)
    imgui.GetIO().MouseDoubleClickTime = 60.0
    hand.click(*np.array(SIZE) / 2)
    hand.click(*np.array(SIZE) / 2)
    assert len(session.face.edits) == 1


def test_an_edit_is_seen_before_the_interior_is_known(hand, session, monkeypatch):
    hand.frames(2)
    asked = []
    monkeypatch.setattr(session, "interior", lambda: asked.append(session.face) or np.ones(1500, dtype=bool))
    session.mode = "carve"
    session.click([0.0, 0.0, 0.75])
    hand.frames(1)
    assert asked == []
    assert polyscope.has_point_cloud("charges")
    hand.frames(3)
    assert asked == [session.face]
    session.alpha = 0.02
    hand.frames(1)
    assert len(asked) == 2


def test_shielding_on_the_field(hand, tmp_path):
    session = hand.viewer.session
    look((1.5, -1.5, 4.5), (0.0, 0.0, 1.468))
    hand.press("shield")
    # The plane across z, at 98 % of the height: the mouth of the mug.
    session.plane = Plane(2, 0.98)
    polyscope.get_surface_mesh("field").set_enabled(True)
    hand.frames(2)
    hand.click(SIZE[0] / 2, SIZE[1] / 2)
    (edit,) = session.face.edits
    assert edit.kind == "cage"
    np.testing.assert_allclose(edit.position, [0.0, 0.0, -0.1 + 0.98 * 1.6], atol=0.05)
    assert f"{len(edit.places)} vertices of the mesh joined" in hand.viewer.message
    assert polyscope.get_point_cloud("cage points").n_points() == len(edit.places)
    polyscope.get_surface_mesh("field").set_enabled(False)
    assert green(hand.picture(tmp_path / "shield.png")) > 100


def test_a_sensor_by_the_mouse(hand, session, tmp_path):
    """In the middle of the mug, on the field: what it sees is told, and the normals face it."""
    outward = session.face.normals()
    session.plane = Plane(1, 0.5)
    hand.viewer.picture.open = True
    hand.frames(2)
    look((0.0, 6.0, 1.1), (0.0, 0.0, 1.1))
    before = hand.picture(tmp_path / "before.png")
    hand.press("sensor")
    hand.click(SIZE[0] / 2, SIZE[1] / 2 + 60)  # below the panel
    assert session.face.edits == ()
    (place,) = session.viewpoints
    np.testing.assert_allclose(place, [0.0, 0.0, 0.7], atol=0.1)
    assert hand.viewer.message == "1 sensors"
    assert polyscope.get_point_cloud("sensors").n_points() == 1
    seen = session.lit()
    wall = np.hypot(*session.points[:, :2].T)
    inner = (np.abs(session.points[:, 2] - 0.7) < 0.5) & (wall < np.quantile(wall, 0.4))
    assert seen[inner].mean() > 0.9
    assert seen[session.points[:, 2] < -0.05].mean() < 0.2
    # The middle of the plane is seen, what lies beyond the wall is not.
    lit = session.lit_places(np.array([[0.1, 0.0, 0.6], [2.0, 0.0, 0.6]]))
    assert lit.tolist() == [True, False]
    # Here and there sight goes through a wall as thin as the spacing: that does not turn its outer side.
    facing = (session.face.normals() * (place - session.points)).sum(axis=1) > 0
    assert facing[seen & inner].mean() > 0.95
    assert facing[wall > wall.max() - 0.02].mean() < 0.02
    assert tuple(name for name, _ in hand.viewer.picture.legend if name.startswith("se")) == ("seen", "sensor")
    assert not np.array_equal(hand.picture(tmp_path / "after.png"), before)
    hand.press("save viewpoints")
    np.testing.assert_allclose(read_cloud(hand.viewer.files["viewpoints"]).points, [place])
    hand.press("undo")
    assert len(session.viewpoints) == 0
    assert session.lit() is None
    np.testing.assert_array_equal(session.face.normals(), outward)
    hand.press("save viewpoints")
    assert hand.viewer.message.startswith("there are no sensors")
    hand.press("redo")
    hand.press("clear")
    assert len(session.viewpoints) == 0


def test_the_filter_is_slid_across_the_points(hand, session):
    session.alpha = 0.3
    hand.frames(3)
    inside = session.interior()
    assert inside.any()
    counts = []
    for fraction in (0.0, 0.5, 1.0):
        hand.viewer.picture.filtered = fraction
        hand.frames(1)
        counts.append(polyscope.get_point_cloud("points").n_points())
    assert counts[0] == 1500
    assert counts[0] > counts[1] > counts[2]
    assert counts[2] <= 1500 - inside.sum() + 2  # one stands at the very end
    hand.viewer.picture.filtered = 0.0


def test_a_refusal_is_said_in_the_panel(hand):
    session = hand.viewer.session
    session.mode = "carve"
    polyscope.register_point_cloud("far", np.array([[0.0, 0.0, 5.0]]), radius=0.05)
    look((3.0, -3.0, 7.0), (0.0, 0.0, 5.0))
    hand.click(SIZE[0] / 2, SIZE[1] / 2)
    assert "lies on or outside the box" in hand.viewer.message
    assert session.face.edits == ()
    hand.click(5, SIZE[1] - 5)  # on nothing
    assert session.face.edits == ()


def test_sliders_and_buttons(hand, tmp_path):
    viewer, session = hand.viewer, hand.viewer.session
    hand.press("alpha", 0.75)
    # The slider is logarithmic, from 0.0001 to 0.5.
    assert 0.1 < session.alpha < 0.5
    hand.press("alpha", 0.44)
    assert 0.003 < session.alpha < 0.02
    assert not polyscope.get_surface_mesh("field").is_enabled()
    hand.press("field at", 0.22)
    assert 0.15 < session.plane.place < 0.35
    assert polyscope.get_surface_mesh("field").is_enabled()
    hand.press("auto")
    assert session.automatic
    hand.press("show surface")
    assert polyscope.has_surface_mesh("surface")
    assert "triangles" in viewer.message
    hand.press("alpha", 0.4)
    assert not polyscope.has_surface_mesh("surface")  # it was that of another alpha
    hand.press("save mesh")
    assert len(read_cloud(tmp_path / "mesh.ply")) > 100
    hand.press("save sculpt")
    assert SculptFile.load(tmp_path / "edits.json") == SculptFile()
    viewer.files["mesh"] = str(tmp_path / "nowhere" / "mesh.ply")
    hand.press("save mesh")
    assert "there is no folder" in viewer.message


def test_a_threshold_above_the_field_leaves_no_proxy(hand, session):
    session.face.vertex_strength[:] += 1.0
    try:
        session.alpha = 0.011
        hand.frames(2)
        assert not polyscope.has_surface_mesh("proxy")
    finally:
        session.face.vertex_strength[:] -= 1.0


def test_a_picture_from_the_command_line(tmp_path, capsys):
    np.save(tmp_path / "shell.npy", shapes.spherical_shell(400).points)
    SculptFile(charges=((0.0, 0.0, 0.0),)).save(tmp_path / "edits.json")
    words = ["view", tmp_path / "shell.npy", "--sculpt", tmp_path / "edits.json", "--up", "y"]
    words += ["--cut", "z", "--screenshot", tmp_path / "shell.png", "--json", "--quiet"]
    assert main([str(word) for word in words]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["points"], summary["charges"], summary["cage_points"]) == (400, 1, 0)
    picture = np.asarray(Image.open(tmp_path / "shell.png").convert("RGB"))
    assert (np.ptp(picture, axis=2) > 20).mean() > 0.02


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--screenshot", "shot.gif"], "allowed are .png, .jpg"),
        (["--save-mesh", "mesh.xyz"], "allowed are .ply"),
        (["--save-sculpt", "edits.ply"], "allowed are .json"),
        (["--save-viewpoints", "views.gif"], "allowed are .ply"),
    ],
)
def test_bad_names_are_said_at_once(tmp_path, capsys, words, message):
    assert main(["view", str(tmp_path / "missing.npy"), *words]) == 2
    assert message in capsys.readouterr().err


def test_without_polyscope(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "polyscope", None)
    assert main(["view", str(tmp_path / "missing.npy")]) == 3
    assert "pip install 'face-plugin[viewer]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ([], 1, "there is no display to open a window on"),
        (["--screenshot", "shot.png"], 3, "apt-get install libegl1 libgl1 libx11-6"),
    ],
)
def test_without_a_display_or_a_renderer(tmp_path, words, code, message):
    np.save(tmp_path / "ball.npy", shapes.sphere(100).points)
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "XDG_SESSION_TYPE")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    # A folder without drivers, as on a machine that has none.
    environment["__EGL_VENDOR_LIBRARY_FILENAMES"] = str(tmp_path / "none.json")
    done = subprocess.run(
        [sys.executable, "-m", "face_plugin.app.cli", "view", "ball.npy", "--quiet", *words],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == code, done.stderr
    assert message in done.stderr
    assert not (tmp_path / "shot.png").exists()
