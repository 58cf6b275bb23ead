"""What the figures share: matplotlib without a display, and saving."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.app.plot.render import Image
from face_plugin.app.plot.section import Section
from face_plugin.errors import require
from face_plugin.io import check_output
from face_plugin.io.cloudfile import replacing
from face_plugin.threads import KDTree

__all__ = ["PLOT_SUFFIXES", "Matplotlib", "new_figure", "save_figure", "show", "spacing_of", "where"]

Array = NDArray[Any]

PLOT_SUFFIXES = (".png", ".jpg", ".pdf", ".svg")
DPI = 130


def save_figure(figure: Any, path: str | os.PathLike[str]) -> None:
    """Write a figure to PNG, JPG, PDF or SVG; an existing file is replaced when the new one is whole.

    Raises
    ------
    ValueError
        Another extension.

    Examples
    --------
    >>> import tempfile
    >>> from matplotlib.figure import Figure
    >>> save_figure(Figure(), tempfile.mkdtemp() + "/empty.png")
    """
    path = check_output(path, PLOT_SUFFIXES)
    with replacing(Path(path)) as temporary:
        figure.savefig(temporary, dpi=DPI, facecolor="white")


class Matplotlib:
    """The parts of matplotlib in use; pyplot is not one of them: it would choose a window system."""

    def __init__(self) -> None:
        matplotlib = require("matplotlib", extra="plot")
        self.colormaps = matplotlib.colormaps
        self.Figure = require("matplotlib.figure", extra="plot").Figure
        self.Normalize = require("matplotlib.colors", extra="plot").Normalize
        self.ScalarMappable = require("matplotlib.cm", extra="plot").ScalarMappable
        self.Rectangle = require("matplotlib.patches", extra="plot").Rectangle
        self.LineCollection = require("matplotlib.collections", extra="plot").LineCollection


def new_figure(plt: Matplotlib, width: float, height: float, title: str) -> Any:
    """Make an empty figure of this size in inches."""
    figure = plt.Figure(figsize=(width, height))
    if title:
        figure.suptitle(title, fontsize=14, fontweight="bold", y=0.975)
    return figure


def spacing_of(points: Array) -> float:
    """Return the median distance to the nearest other point."""
    distances = KDTree(points).query(points, k=2)[0][:, 1]
    apart = distances[distances > 0]
    return float(np.median(apart)) if len(apart) else 1.0


def show(axes: Any, image: Image | None, title: str) -> None:
    """Put a rendered image, or nothing, into a panel."""
    if image is not None:
        axes.imshow(image, interpolation="lanczos")
    axes.set_title(title)
    axes.set_axis_off()


def where(section: Section, points: Array) -> str:
    """Say where the plane is, to a thousandth of the object's size."""
    digits = 3 - int(np.floor(np.log10(max(float(np.ptp(points, axis=0).max()), 1e-300))))
    return f"{section.labels[2]} = {round(section.at, digits) + 0.0:g}"
