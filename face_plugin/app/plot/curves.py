"""What the method says of points in the plane: the field, and the normals of the curve."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from face_plugin.app.plot.figures import Array, Matplotlib, new_figure

__all__ = ["plot_curves"]

# Field strengths are drawn up to this quantile: a few sharp tips would take the whole scale.
TOP = 0.97
# Space around the points, and the length of a normal, as fractions of their extent.
MARGIN, NORMAL = 0.08, 0.05
# Normals that are drawn at most: more would run into one another.
MOST = 600
PIXELS = 500
KEPT, INTERIOR = "#16324f", "#d1495b"


def plot_curves(
    points: ArrayLike,
    normals: ArrayLike,
    field: Callable[[Array], Array],
    *,
    interior: ArrayLike | None = None,
    alpha: float | None = None,
    title: str = "",
) -> Any:
    """Draw (a) E_max in the plane, with the points, and (b) their normals.

    Parameters
    ----------
    points, normals : (n, 2) array_like
        In the unit of the input.
    field : callable
        E_max (k,) at any positions (k, 2), NaN where not known: `field_within(face)`, or `FaCE.strength`.
    interior : (n,) array_like of bool, optional
        Points that lie inside are drawn in red.
    alpha : float, optional
        Draw this level of the field.
    title : str
        Above the figure.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MissingDependencyError
        Without matplotlib.

    Examples
    --------
    >>> from face_plugin import FaCE
    >>> from face_plugin.shapes.curves import star
    >>> face = FaCE(star(200).points)
    >>> len(plot_curves(star(200).points, face.normals(), face.strength).axes)
    3
    """
    plt = Matplotlib()
    points, normals = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
    inside = np.zeros(len(points), dtype=np.bool_) if interior is None else np.asarray(interior)
    lower, upper = points.min(axis=0), points.max(axis=0)
    longest = float((upper - lower).max())
    lower, upper = lower - MARGIN * longest, upper + MARGIN * longest
    figure = new_figure(plt, 12.0, 6.4, title)
    left, right = figure.subplots(1, 2, gridspec_kw={"left": 0.05, "right": 0.97, "bottom": 0.2, "wspace": 0.15})
    x, y = (np.linspace(lower[k], upper[k], PIXELS) for k in range(2))
    places = np.stack(np.meshgrid(x, y), axis=-1)
    values = np.asarray(field(places.reshape(-1, 2))).reshape(PIXELS, PIXELS)
    extent = (lower[0], upper[0], lower[1], upper[1])
    norm = plt.Normalize(0.0, max(float(np.nanquantile(values, TOP)), 1e-12))
    drawn = left.imshow(values, origin="lower", extent=extent, cmap="magma", norm=norm, interpolation="bilinear")
    left.scatter(*points.T, s=3, c="white", linewidths=0)
    if alpha is not None and np.nanmin(values) < alpha < np.nanmax(values):
        left.contour(x, y, values, [alpha], colors="#7fe0c4", linewidths=1.1)
    level = "" if alpha is None else f", line at {alpha:g}"
    left.set_title(f"$E_{{\\max}}${level}")
    bar = figure.colorbar(drawn, cax=figure.add_axes((0.12, 0.1, 0.3, 0.022)), orientation="horizontal", extend="max")
    bar.set_label(r"$E_{\max}$  (unshielded space has 1)")
    step = -(-len(points) // MOST)
    for rows, colour in ((~inside, KEPT), (inside, INTERIOR)):
        right.scatter(*points[rows].T, s=6, c=colour, linewidths=0)
        some = np.flatnonzero(rows)[::step]
        tips = points[some] + NORMAL * longest * normals[some]
        lines = plt.LineCollection(np.stack([points[some], tips], axis=1), colors=colour, linewidths=0.7)
        right.add_collection(lines)
    right.set_title("Normals" if interior is None else "Normals; points inside are red")
    for axes in (left, right):
        axes.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), aspect="equal")
    return figure
