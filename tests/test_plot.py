"""The renderer against geometry, sections against known solids, and the two figures."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from face_plugin.app.plot import Camera, plot_interior, plot_result, render_mesh, render_points, save_figure
from face_plugin.app.plot.section import Section

BALL = trimesh.creation.icosphere(subdivisions=4)
VERTICES, FACES = np.asarray(BALL.vertices), np.asarray(BALL.faces)
RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def reddish(image: np.ndarray) -> np.ndarray:
    return (image[..., 3] > 250) & (image[..., 0].astype(int) > 2 * image[..., 1].astype(int) + 20)


def greenish(image: np.ndarray) -> np.ndarray:
    return (image[..., 3] > 250) & (image[..., 1].astype(int) > 2 * image[..., 0].astype(int) + 20)


def test_a_ball_covers_the_area_of_a_disc() -> None:
    image = render_mesh(VERTICES, FACES, size=200)
    covered = image[..., 3].sum() / 255
    # The picture is 1.06 diameters wide; a third of the pixels on the boundary is allowed.
    assert covered == pytest.approx(np.pi / 4 * (200 / 1.06) ** 2, abs=200)
    assert image[100, 100, 3] == 255
    assert image[0, 0, 3] == 0


@pytest.mark.parametrize("order", [1, -1])
def test_the_nearer_mesh_hides_the_farther(order: int) -> None:
    vertices = np.concatenate([VERTICES, 0.5 * VERTICES + [2.0, 0.0, 0.0]])
    faces = np.concatenate([FACES, FACES + len(VERTICES)])[::order]
    colours = np.repeat([RED, GREEN], len(VERTICES), axis=0)
    camera = Camera.around(VERTICES, view=(0.0, 0.0))
    near = render_mesh(vertices, faces, camera=camera, colours=colours, size=100)
    far = render_mesh(vertices, faces, camera=Camera.around(VERTICES, view=(180.0, 0.0)), colours=colours, size=100)
    assert greenish(near)[50, 50]
    assert reddish(near)[50, 10]
    assert not greenish(far).any()


def test_faces_seen_from_behind_have_their_own_colour() -> None:
    outward = render_mesh(VERTICES, FACES, colour=GREEN, back=RED, size=100)
    inward = render_mesh(VERTICES, FACES[:, ::-1], colour=GREEN, back=RED, size=100)
    assert not reddish(outward).any()
    assert not greenish(inward).any()
    assert reddish(inward)[50, 50]


def test_light_comes_from_above() -> None:
    image = render_mesh(VERTICES, FACES, size=100).astype(float)
    assert image[20, 50, :3].mean() > 1.5 * image[80, 50, :3].mean()


def test_neighbouring_triangles_leave_no_gap() -> None:
    """A sphere of large and of tiny triangles: every pixel well inside the outline is covered."""
    rows, columns = np.mgrid[:150, :150]
    inside = np.hypot(rows - 74.5, columns - 74.5) < 60
    for level in (1, 5):
        ball = trimesh.creation.icosphere(subdivisions=level)
        image = render_mesh(ball.vertices, ball.faces, size=150, camera=Camera.around(VERTICES))
        assert (image[inside][:, 3] == 255).all()


def test_points_are_balls_or_discs_of_their_radius() -> None:
    points = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    camera = Camera(np.eye(3), np.zeros(3), 4.0)
    ball = render_points(points, [RED, GREEN], radius=1.0, camera=camera, size=200)
    assert ball[..., 3].sum() / 255 == pytest.approx(np.pi * 50**2, rel=0.01)
    assert not greenish(ball).any()  # outside of the picture
    tilted = np.array([[0.0, np.sin(1.0), np.cos(1.0)]] * 2)
    disc = render_points(points, [RED, GREEN], radius=1.0, normals=tilted, camera=camera, size=200)
    assert disc[..., 3].sum() / 255 == pytest.approx(np.pi * 50**2 * np.cos(1.0), rel=0.02)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_the_chosen_axis_points_upward(up: str) -> None:
    camera = Camera.around(VERTICES, view=(20.0, 10.0), up=up)
    k = "xyz".index(up)
    tip = camera.project(np.eye(3)[k : k + 1], 100)[0]
    assert tip[0] == pytest.approx(50)
    assert tip[1] < 50
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(camera.axes) == pytest.approx(1.0)


def test_an_empty_mesh_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing to render"):
        render_mesh(np.zeros((0, 3)), np.zeros((0, 3), int))


def test_a_ball_is_cut_in_circles() -> None:
    section = Section(axis=1, at=0.6, across=0, upward=2)
    segments = section.outline(VERTICES, FACES)
    # The chords of this sphere's triangles lie up to 0.4 % inside of the sphere.
    np.testing.assert_allclose(np.linalg.norm(segments.reshape(-1, 2), axis=1), 0.8, rtol=6e-3)
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum()
    assert length == pytest.approx(2 * np.pi * 0.8, rel=6e-3)


@pytest.mark.parametrize("at", [0.0, 0.3, -0.7])
def test_the_part_behind_a_plane_is_exact(at: float) -> None:
    section = Section(axis=1, at=at, across=0, upward=2)
    vertices, faces = section.behind(VERTICES, FACES)
    # x to the right and z upward is the view from -y: what is kept lies at larger y.
    assert vertices[faces][..., 1].min() >= at - 1e-12
    cap = trimesh.Trimesh(vertices, faces).area
    assert cap == pytest.approx(2 * np.pi * (1 - at), rel=2e-3)


def test_the_section_is_taken_across_the_shortest_side() -> None:
    points = VERTICES * [3.0, 1.0, 2.0] + 5.0
    section = Section.through(points)
    assert section.labels == ("x", "z", "y")
    assert section.at == pytest.approx(5.0)
    positions, extent = section.grid(points, 50)
    assert positions.shape[1] == 50
    assert np.all(positions[..., 1] == 5.0)
    assert extent[0] < 2.0
    assert extent[1] > 8.0


def looks_drawn(path: Path) -> bool:
    """Tell whether a picture has many colours over much of its area."""
    pixels = (matplotlib.image.imread(path)[..., :3] * 255).astype(np.int64)
    colours = np.unique(pixels @ [1, 256, 65536])
    return len(colours) > 3000 and (pixels < 250).any(axis=2).mean() > 0.2


def test_figure_of_a_result(tmp_path: Path) -> None:
    def field(positions: np.ndarray) -> np.ndarray:
        return np.where(np.abs(positions).max(axis=1) > 1.2, np.nan, np.linalg.norm(positions, axis=1))

    figure = plot_result(VERTICES, VERTICES, VERTICES[:, 2] + 1.0, field, alpha=0.5, title="ball", pixels=200)
    save_figure(figure, tmp_path / "a.png")
    assert looks_drawn(tmp_path / "a.png")
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    assert [text.get_text() for text in figure.texts] == ["ball"]
    assert "y = 0" in figure.axes[2].get_title() or "x = 0" in figure.axes[2].get_title()


def test_figure_of_the_interior_filter(tmp_path: Path) -> None:
    points = np.concatenate([VERTICES, 0.4 * VERTICES])
    interior = np.repeat([False, True], len(VERTICES))
    both = points, np.concatenate([FACES, FACES + len(VERTICES)])
    figure = plot_interior(points, interior, both, (VERTICES, FACES), pixels=150)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[0].startswith("2,562 of 5,124 points dropped")
    assert titles[1] == "All 5,124 points"
    assert "2,562 points kept" in titles
    save_figure(figure, tmp_path / "a.png")
    assert looks_drawn(tmp_path / "a.png")


@pytest.mark.parametrize("suffix", [".jpg", ".pdf", ".svg"])
def test_figures_in_other_formats(tmp_path: Path, suffix: str) -> None:
    figure = Figure()
    figure.add_subplot().plot([0, 1], [1, 0])
    save_figure(figure, tmp_path / f"a{suffix}")
    magic = {".jpg": b"\xff\xd8", ".pdf": b"%PDF", ".svg": b"<?xml"}[suffix]
    assert (tmp_path / f"a{suffix}").read_bytes().startswith(magic)


def test_other_extensions_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"allowed are \.png"):
        save_figure(Figure(), tmp_path / "a.gif")
