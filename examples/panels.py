"""Pictures side by side, for the examples."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image as Picture

from face_plugin.app.plot import Camera, render_mesh, render_points, save_figure


def aligned(normals: Any, truth: Any) -> float:
    """Percentage of normals on the right side; points without a true one (NaN) do not count."""
    cosine = (np.asarray(normals) * np.asarray(truth)).sum(axis=1)
    return 100.0 * float((cosine[~np.isnan(cosine)] > 0).mean())


def cloud_image(points: Any, normals: Any) -> Any:
    """Render points as discs that face along their normals, painted by direction."""
    spacing = float(np.median(np.linalg.norm(points - points.mean(axis=0), axis=1))) * 3 / len(points) ** 0.5
    return render_points(points, 0.5 + 0.5 * np.asarray(normals), radius=spacing, normals=normals, size=500)


def mesh_image(vertices: Any, faces: Any, points: Any) -> Any:
    """Render a mesh as seen by the camera that shows the points; what is inside out is painted red."""
    return render_mesh(vertices, faces, camera=Camera.around(points), size=500)


def save_panels(path: Path, panels: list[tuple[str, Any]]) -> None:
    """Write titled images next to each other to a PNG."""
    figure = Figure(figsize=(4.2 * len(panels), 4.6))
    FigureCanvasAgg(figure)
    for axes, (title, image) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True):
        axes.imshow(image)
        axes.set_title(title, fontsize=10)
        axes.axis("off")
    figure.tight_layout()
    save_small(figure, path)


def save_small(figure: Figure, path: Path) -> None:
    """Write a figure to a PNG of few colours: a third of the bytes."""
    save_figure(figure, path)
    with Picture.open(path) as picture:
        small = picture.convert("RGB").quantize(160, kmeans=1)
    small.save(path, optimize=True)
