"""Outward normals as a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from face_plugin.filters.base import Filter
from face_plugin.filters.pointset import PointSet
from face_plugin.params import Params
from face_plugin.stages import Progress

__all__ = ["Normals"]


@dataclass(frozen=True)
class Normals(Filter):
    """Give the kept points outward unit normals, and the attributes ``strength`` and ``confidence``.

    Parameters
    ----------
    params : Params, optional
        By default those of the cage solved so far, or the package's.

    Examples
    --------
    >>> from face_plugin.filters import PointSet
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(300)
    >>> bool(((Normals()(PointSet(ball.points)).normals * ball.normals).sum(axis=1) > 0).all())
    True
    """

    name: ClassVar[str] = "normals"
    params: Params | None = None

    def __call__(self, layer: PointSet, *, progress: Progress | None = None) -> PointSet:
        """Return `layer` with normals; those of points not kept are zero."""
        cage = layer.solved(self.params, progress)
        result = cage.result()
        attributes = {
            **layer.attributes,
            "strength": layer.scatter(result.strength),
            "confidence": layer.scatter(result.confidence),
        }
        return layer.replace(normals=layer.scatter(result.normals), attributes=attributes, cage=cage)
