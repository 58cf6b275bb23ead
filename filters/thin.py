"""Thinning to a minimum distance as a step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from face_plugin.filters.base import Filter
from face_plugin.filters.pointset import PointSet
from face_plugin.geometry import thin
from face_plugin.stages import Progress

__all__ = ["Thin"]


@dataclass(frozen=True)
class Thin(Filter):
    """Keep a random-order Poisson-disk subset: no two kept points are nearer than `distance`.

    Parameters
    ----------
    distance : float, in the unit of the points, > 0
    seed : int, >= 0

    Raises
    ------
    ValueError
        A setting is out of range.

    Examples
    --------
    >>> from face_plugin.filters import PointSet
    >>> from face_plugin.shapes import sphere
    >>> int(Thin(0.5)(PointSet(sphere(1000).points)).keep.sum()) < 100
    True
    """

    name: ClassVar[str] = "thin"
    distance: float
    seed: int = 0

    def __post_init__(self) -> None:
        number = isinstance(self.distance, (int, float)) and not isinstance(self.distance, bool)
        if not number or not 0 < self.distance < math.inf:
            raise ValueError(f"distance must be a finite number > 0, found {self.distance!r}")
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or self.seed < 0:
            raise ValueError(f"seed must be an integer >= 0, found {self.seed!r}")

    def __call__(self, layer: PointSet, *, progress: Progress | None = None) -> PointSet:
        """Return `layer` with the points left out of ``keep``."""
        rows = np.flatnonzero(layer.keep)
        if len(rows) == 0:
            return layer
        points = layer.points[rows].astype(np.float64)
        keep = np.zeros(len(layer), dtype=np.bool_)
        keep[rows[thin(points, np.full(len(rows), float(self.distance)), self.seed)]] = True
        return layer.replace(keep=keep)
