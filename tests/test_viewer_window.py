"""The viewer as it is seen and clicked on."""

from __future__ import annotations

import numpy as np
import polyscope
import polyscope.imgui as imgui
import pytest
from PIL import Image
from viewing import SIZE, green, look, look_into_the_mug, yellow

from face_plugin.app.viewer.session import Plane
from face_plugin.app.viewer.window import Viewer
from face_plugin.io import read_cloud
from face_plugin.sculpt import SculptFile


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
