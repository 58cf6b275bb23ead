"""What leaving out interior points does to the surface."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.app.plot.figures import Array, Matplotlib, new_figure, show, spacing_of, where
from face_plugin.app.plot.render import Camera, Up, View, render_mesh
from face_plugin.app.plot.section import Section
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.reach import Reach

__all__ = ["plot_interior", "space_reached"]

KEPT, DROPPED, STRAY = "#2f5d8a", "#d9482b", "#e2a400"
REACHED = "#dcecf7"
PIXELS = 400
"""Of the longer side of the section where the space that is reached is drawn."""
MARGIN = 0.06
# Points that tell what is reached: so many show a section, and more take a minute to mesh.
MOST = 50_000
UNFILTERED, FILTERED = "#a9a9ad", "#1d1d1f"


def space_reached(points: ArrayLike, normals: ArrayLike) -> Callable[[Array], NDArray[np.bool_]]:
    """Return what tells of any places (k, 3) whether free space gets to them, past points with normals (n, 3).

    Examples
    --------
    >>> import numpy as np
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> space_reached(ball.points, ball.normals)(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]])).tolist()
    [False, True]
    """
    distinct, rows = np.unique(np.asarray(points, dtype=np.float64), axis=0, return_index=True)
    some = np.arange(len(rows))
    if len(rows) > MOST:
        some = np.random.default_rng(0).choice(len(rows), MOST, replace=False)
    return partial(Reach.places, Neighbourhood(distinct[some]), np.asarray(normals, dtype=np.float64)[rows[some]])


def plot_interior(
    points: ArrayLike,
    interior: ArrayLike,
    unfiltered: tuple[ArrayLike, ArrayLike],
    filtered: tuple[ArrayLike, ArrayLike],
    *,
    strays: ArrayLike | None = None,
    reached: Callable[[Array], NDArray[np.bool_]] | None = None,
    title: str = "",
    view: View = (35.0, 20.0),
    up: Up = "z",
    axis: Up | None = None,
    pixels: int = 640,
) -> Any:
    """Draw the points kept and dropped in section, and the surfaces made from all points and from those kept.

    Parameters
    ----------
    points : (n, 3) array_like
        In the unit of the input.
    interior : (n,) array_like of bool
        The points dropped.
    unfiltered, filtered : (vertices, faces)
        The surface from all points, and from the points kept.
    strays : (n,) array_like of bool, optional
        Points that take no part.
    reached : callable, optional
        Which places (k, 3) free space gets to, as `space_reached` tells; they are tinted in the section.
    title, view, up, axis, pixels
        As in `plot_result`.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MissingDependencyError
        Without matplotlib.

    Examples
    --------
    >>> import numpy as np
    >>> corners = np.concatenate([np.eye(3), np.zeros((1, 3))])
    >>> mesh = corners, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    >>> len(plot_interior(corners, [False] * 4, mesh, mesh).axes)
    5
    """
    plt = Matplotlib()
    points, interior = np.asarray(points, dtype=np.float64), np.asarray(interior, dtype=np.bool_)
    stray = np.zeros(len(points), dtype=np.bool_) if strays is None else np.asarray(strays, dtype=np.bool_)
    meshes = [(np.asarray(v, dtype=np.float64), np.asarray(f)) for v, f in (unfiltered, filtered)]
    shown = points[~stray]
    section = Section.through(shown, up=up, axis=axis)
    camera = Camera.around(shown, view=view, up=up, margin=1.12)
    facing = Camera.around(shown, view=_facing(section, up), up=up, margin=1.12)
    figure = new_figure(plt, 15.6, 8.4, title)
    # Axis labels and the legend stand under the section, nothing under the renderings.
    drawing = figure.add_gridspec(1, 1, left=0.045, right=0.41, bottom=0.16, top=0.89)
    grid = figure.add_gridspec(2, 2, left=0.44, right=0.99, bottom=0.02, top=0.89, wspace=0.06, hspace=0.1)
    axes = figure.add_subplot(drawing[0])
    if reached is not None:
        _draw_reached(plt, axes, shown, reached, section)
    _draw_section(plt, axes, points, interior, stray, meshes, section)
    names = (f"All {len(points):,} points", f"{int((~interior & ~stray).sum()):,} points kept")
    for column, (vertices, faces), name in zip((0, 1), meshes, names, strict=True):
        whole = render_mesh(vertices, faces, camera=camera, size=pixels)
        show(figure.add_subplot(grid[0, column]), whole, name)
        cut = section.behind(vertices, faces)
        image = render_mesh(*cut, camera=facing, size=pixels) if len(cut[1]) else None
        show(figure.add_subplot(grid[1, column]), image, "cut open")
    return figure


def _draw_reached(
    plt: Matplotlib, axes: Any, shown: Array, reached: Callable[[Array], NDArray[np.bool_]], section: Section
) -> None:
    places, (left, right, bottom, top) = section.grid(shown, PIXELS, MARGIN)
    rows, columns, _ = places.shape
    axes.contourf(
        np.linspace(left, right, columns),
        np.linspace(bottom, top, rows),
        reached(places.reshape(-1, 3)).reshape(rows, columns),
        levels=[0.5, 1.5],
        colors=[REACHED],
        zorder=0,
    )
    # A contour has no entry of its own in a legend.
    axes.add_patch(plt.Rectangle((left, bottom), 0, 0, color=REACHED, label="reached from outside"))


def _draw_section(
    plt: Matplotlib,
    axes: Any,
    points: Array,
    interior: Array,
    stray: Array,
    meshes: list[tuple[Array, Array]],
    section: Section,
) -> None:
    # Two spacings to either side: enough points to show a curve, few enough to keep it thin.
    near = section.near(points, 2.0 * spacing_of(points[~stray]))
    for (vertices, faces), colour, name in zip(
        meshes, (UNFILTERED, FILTERED), ("surface from all points", "surface from points kept"), strict=True
    ):
        axes.add_collection(
            plt.LineCollection(section.outline(vertices, faces), colors=colour, linewidths=1.2, label=name)
        )
    # A stray is shown wherever it is: the section alone would miss most of the few there are.
    marks = ((near & ~interior & ~stray, KEPT, "kept"), (near & interior, DROPPED, "dropped"), (stray, STRAY, "stray"))
    for mask, colour, name in marks:
        if name == "stray" and not mask.any():
            continue
        flat = section.flatten(points[mask])
        axes.scatter(flat[:, 0], flat[:, 1], s=7, c=colour, linewidths=0, label=name, zorder=3)
    across, upward, _ = section.labels
    share = f"{int(interior.sum()):,} of {len(points):,} points dropped"
    share += f", {int(stray.sum()):,} stray" if stray.any() else ""
    axes.set(xlabel=across, ylabel=upward, aspect="equal", title=f"{share}\nsection at {where(section, points)}")
    # Strays may lie anywhere: the picture is that of the others.
    _, (left, right, bottom, top) = section.grid(points[~stray], 2, MARGIN)
    axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(
        loc="lower center",
        bbox_to_anchor=(0.225, 0.01),
        bbox_transform=axes.figure.transFigure,
        ncols=3,
        frameon=False,
        markerscale=2,
    )


def _facing(section: Section, up: Up) -> View:
    """Return the view of the plane that matches its drawing, a little from above and from the side."""
    k = "xyz".index(up)
    if section.axis == k:
        return 90.0, float(np.copysign(65.0, section.normal[k]))
    ahead, side = section.normal[(k + 1) % 3], section.normal[(k + 2) % 3]
    return float(np.degrees(np.arctan2(side, ahead))) + 18.0, 14.0
