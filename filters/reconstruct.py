"""Surface reconstruction as a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from face_plugin.filters.base import Filter
from face_plugin.filters.pointset import PointSet
from face_plugin.result import Mesh
from face_plugin.stages import Progress
from face_plugin.surface import Backend, poisson_reconstruction
from face_plugin.trimming import TrimDistance

__all__ = ["Reconstruct"]


@dataclass(frozen=True)
class Reconstruct(Filter):
    """Reconstruct the surface of the kept points but strays from their normals, by a host's Poisson reconstruction.

    Parameters
    ----------
    depth, screened, backend, trim, trim_distance
        As in `face_plugin.reconstruct`; which points are open the attribute ``open`` tells, where a 'normals' step left
        it. None is "none" in a file.

    Examples
    --------
    >>> from face_plugin.filters import PointSet
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(300)
    >>> Reconstruct(depth=4)(PointSet(ball.points, ball.normals)).surface.faces.shape[1]
    3
    """

    name: ClassVar[str] = "surface"
    depth: int = 8
    screened: bool = True
    backend: Backend | None = None
    trim: float = 0.0
    trim_distance: TrimDistance | Literal["none"] = "auto"

    def __post_init__(self) -> None:
        if self.trim_distance is None:
            object.__setattr__(self, "trim_distance", "none")

    def __call__(self, layer: PointSet, *, progress: Progress | None = None) -> PointSet:
        """Return `layer` with its ``surface``.

        Raises
        ------
        ValueError
            The points have no normals, or none are kept.
        MissingDependencyError
            No host is installed.
        """
        if layer.normals is None:
            raise ValueError("a surface needs normals, and the points have none: put a 'normals' step first")
        if not layer.keep.any():
            raise ValueError(f"a surface needs points, and none of the {len(layer)} are kept")
        # Strays are of no surface, also where no interior step left them out.
        keep = layer.keep if layer.cage is None else layer.keep & ~layer.scatter(layer.cage.strays)
        opened = layer.attributes.get("open")
        if progress is not None:
            progress("surface", 0.0)
        vertices, faces, densities = poisson_reconstruction(
            layer.points[keep],
            layer.normals[keep],
            depth=self.depth,
            screened=self.screened,
            backend=self.backend,
            trim=self.trim,
            trim_distance=None if self.trim_distance == "none" else self.trim_distance,
            open_at=opened[keep] if opened is not None and opened.dtype == np.bool_ else None,
        )
        if progress is not None:
            progress("surface", 1.0)
        return layer.replace(surface=Mesh(vertices, faces, densities))
