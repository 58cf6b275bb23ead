"""What the method says of a cloud: strength, normals, and the field in section."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from face_plugin.app.plot.figures import Array, Matplotlib, new_figure, show, spacing_of, where
from face_plugin.app.plot.render import Camera, Up, View, render_points
from face_plugin.app.plot.section import Section

if TYPE_CHECKING:
    from face_plugin.solver import FaCE

__all__ = ["field_within", "plot_result"]

# Field strengths are drawn up to this quantile: a few sharp tips would take the whole scale.
TOP = 0.95


def plot_result(
    points: ArrayLike,
    normals: ArrayLike,
    strengths: ArrayLike,
    field: Callable[[Array], Array],
    *,
    alpha: float | None = None,
    title: str = "",
    view: View = (35.0, 20.0),
    up: Up = "z",
    axis: Up | None = None,
    pixels: int = 800,
) -> Any:
    """Draw (a) the points coloured by strength, (b) their normals by direction, (c) a slice of E_max.

    Parameters
    ----------
    points, normals : (n, 3) array_like
        In the unit of the input.
    strengths : (n,) array_like
        E_max at the points; unshielded space has 1.
    field : callable
        E_max (k,) at any positions (k, 3), NaN where not known: `field_within(face)`, or `FaCE.strength`.
    alpha : float, optional
        Draw this level of the field in the slice.
    title : str
        Above the figure.
    view : (azimuth, elevation)
        Where the camera stands, degrees.
    up : {"x", "y", "z"}
        The axis that points upward.
    axis : {"x", "y", "z"}, optional
        The axis that the slice cuts across; by default the object's shortest.
    pixels : int
        Width of a rendered panel.

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
    >>> cross = np.concatenate([np.eye(3), -np.eye(3)])
    >>> figure = plot_result(cross, cross, np.ones(6), lambda p: np.linalg.norm(p, axis=1))
    >>> len(figure.axes) >= 3
    True
    """
    plt = Matplotlib()
    points, normals = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
    strengths = np.asarray(strengths, dtype=np.float64)
    camera = Camera.around(points, view=view, up=up)
    spacing = spacing_of(points)
    figure = new_figure(plt, 15.6, 6.6, title)
    box = {"left": 0.01, "right": 0.985, "bottom": 0.22, "top": 0.89, "wspace": 0.1}
    left, middle, right = figure.subplots(1, 3, gridspec_kw={"width_ratios": [1, 1, 1.12], **box})
    norm = plt.Normalize(0.0, max(float(np.quantile(strengths, TOP)), 1e-12))
    colours = plt.colormaps["viridis"](norm(strengths))[:, :3]
    balls = render_points(points, colours, radius=0.8 * spacing, camera=camera, size=pixels)
    show(left, balls, "Field strength at the points")
    _colour_bar(figure, left, plt.ScalarMappable(norm, "viridis"))
    painted = 0.5 + 0.5 * normals
    discs = render_points(points, painted, radius=1.5 * spacing, normals=normals, camera=camera, size=pixels)
    show(middle, discs, "Normals by direction")
    _legend_of_directions(middle, camera)
    _draw_slice(figure, plt, right, points, field, Section.through(points, up=up, axis=axis), spacing, alpha)
    return figure


def field_within(face: FaCE) -> Callable[[Array], Array]:
    """Return `FaCE.strength` with NaN outside the domain, where nothing was computed.

    Examples
    --------
    >>> from face_plugin import FaCE, shapes
    >>> field = field_within(FaCE(shapes.sphere(300).points))
    >>> bool(np.isnan(field(np.array([[9.0, 9.0, 9.0]]))[0]))
    True
    """

    def field(positions: Array) -> Array:
        local = face.frame.to_unit(positions)
        outside = ((local < face.mesh.lower) | (local > face.mesh.upper)).any(axis=1)
        return np.where(outside, np.nan, face.strength(positions))

    return field


def _colour_bar(figure: Any, axes: Any, mappable: Any) -> None:
    # At one height under all panels, however tall the object is.
    left, _, width, _ = axes.get_position(original=True).bounds
    bar_axes = figure.add_axes((left + 0.12 * width, 0.105, 0.76 * width, 0.022))
    bar = figure.colorbar(mappable, cax=bar_axes, orientation="horizontal", extend="max")
    bar.set_label(r"$E_{\max}$  (unshielded space has 1)")
    bar.outline.set_visible(False)


def _legend_of_directions(axes: Any, camera: Camera) -> None:
    """Draw the coordinate axes, each in the colour that a normal along it has."""
    inset = axes.inset_axes((0.0, -0.06, 0.22, 0.22))
    inset.set(xlim=(-1.5, 1.5), ylim=(-1.5, 1.5), aspect="equal")
    inset.set_axis_off()
    for k in np.argsort(camera.axes[2]):
        tip = camera.axes[:2, k]
        colour = 0.5 + 0.5 * np.eye(3)[k]
        inset.annotate("", tip, (0, 0), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.5})
        inset.text(*(1.28 * tip), "xyz"[k], ha="center", va="center")


def _draw_slice(
    figure: Any,
    plt: Matplotlib,
    axes: Any,
    points: Array,
    field: Callable[[Array], Array],
    section: Section,
    spacing: float,
    alpha: float | None,
) -> None:
    positions, extent = section.grid(points, 420)
    values = np.asarray(field(positions.reshape(-1, 3))).reshape(positions.shape[:2])
    norm = plt.Normalize(0.0, max(float(np.nanquantile(values, TOP)), 1e-12))
    drawn = axes.imshow(values, origin="lower", extent=extent, cmap="magma", norm=norm, interpolation="bilinear")
    near = section.flatten(points[section.near(points, spacing)])
    axes.scatter(near[:, 0], near[:, 1], s=5, c="white", linewidths=0)
    if alpha is not None and np.nanmin(values) < alpha < np.nanmax(values):
        axes.contour(values, [alpha], origin="lower", extent=extent, colors="#7fe0c4", linewidths=1.1)
    across, upward, _ = section.labels
    level = "" if alpha is None else f", line at {alpha:g}"
    axes.set(xlabel=across, ylabel=upward, title=f"Slice of $E_{{\\max}}$ at {where(section, points)}{level}")
    axes.spines[:].set_visible(False)
    _colour_bar(figure, axes, drawn)
