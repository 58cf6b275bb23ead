"""What the viewer does to the cage, without a window."""

from __future__ import annotations

import numpy as np
import pytest

from face_plugin import shapes
from face_plugin.app.viewer import session as session_module
from face_plugin.app.viewer.session import Plane, Session
from face_plugin.io import read_cloud
from face_plugin.surface import poisson_reconstruction


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
