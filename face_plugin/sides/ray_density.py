"""How densely the rays of scanners hit a surface: what the spacing of a cloud says of the places it was scanned from.

The rays of a scanner are even in angle. At the distance d from it, and at the angle t to the normal, each has the area
d^2 / cos t of the surface for itself; those of several scanners add up. A scanner that turns leaves rows, dense along
and sparse across: there the points nearest to one another are of one row, and they are d / sin b apart, where b is the
angle between the ray and the row, whatever the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import SPACING_NEIGHBOURS, Neighbourhood

__all__ = ["RayDensity"]

# The nearest points are one row where they spread across by less than this share of their spread along, squared.
ROW = 0.05
# Fewer points of either kind tell nothing.
FEWEST = 50
# A ray that meets the surface, or a row, at a smaller cosine is as good as along it.
GRAZING = 0.05


@dataclass(frozen=True, eq=False)
class RayDensity:
    """Some of the points of a cloud, with the area that each has for itself.

    Examples
    --------
    >>> ray = np.random.default_rng(0).normal(size=(4000, 3))
    >>> ray = ray[ray[:, 2] < -0.4 * np.linalg.norm(ray, axis=1)]
    >>> floor = ray / -ray[:, 2:]  # seen from a height of 1
    >>> seen = RayDensity.of(Neighbourhood(floor), np.tile([0.0, 0.0, 1.0], (500, 1)), np.arange(500))
    >>> here, there = seen.left(seen.expected(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]])))
    >>> bool(here < 0.7 * seen.spread < there)
    True
    """

    points: NDArray[np.float64]
    """(m, 3)"""
    across: NDArray[np.float64]
    """(m, 3) unit normals, of either sign."""
    along: NDArray[np.float64]
    """(m, 3) unit directions of the rows that the points are part of."""
    in_row: NDArray[np.bool_]
    """(m,) which are part of one."""
    area: NDArray[np.float64]
    """(m,) logarithm of the spacing squared."""

    @classmethod
    def of(cls, around: Neighbourhood, across: NDArray[np.float64], some: NDArray[np.intp]) -> RayDensity:
        """Take some points (m,) of a cloud, with their unit normals (m, 3) of either sign."""
        offset = around.points[around.neighbour[some, 1 : SPACING_NEIGHBOURS + 1]] - around.points[some, None]
        spread, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offset, offset))
        in_row = spread[:, 1] < ROW * spread[:, 2]
        area = 2.0 * np.log(around.spacing[some])
        return cls(around.points[some], across, axes[:, :, 2], in_row, area)

    def but_rows(self) -> RayDensity:
        """Leave out what is part of a row."""
        return self.part(~self.in_row)

    def part(self, kept: slice | NDArray[np.bool_]) -> RayDensity:
        """Keep some of the points."""
        return RayDensity(self.points[kept], self.across[kept], self.along[kept], self.in_row[kept], self.area[kept])

    def expected(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """How many rays (k, m) an area gets from each of the places (k, 3), up to a common factor, if it is in sight.

        In a row, that is the number of rays along its length, squared.
        """
        # |x - place|^2 and its products with the normals, without an array of all offsets.
        squared = np.sum(places**2, axis=1)[:, None] - 2.0 * places @ self.points.T + np.sum(self.points**2, axis=1)
        squared = np.maximum(squared, np.finfo(float).eps)
        cosine = np.abs(np.sum(self.points * self.across, axis=1) - places @ self.across.T) / np.sqrt(squared)
        if self.in_row.any():
            along = np.sum(self.points * self.along, axis=1) - places @ self.along.T
            sine = np.sqrt(np.maximum(1.0 - along**2 / squared, 0.0))
            cosine = np.where(self.in_row, sine**2, cosine)
        return np.asarray(np.maximum(cosine, GRAZING) / squared)

    def left(self, density: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far areas (..., m) are from those that densities would cause: median distance from the median.

        The factors of rows and of the rest differ.
        """
        rest = self.area + np.log(density)
        for kind in self._kinds:
            rest[..., kind] -= _median(rest[..., kind])[..., None]
        return _median(np.abs(rest[..., self._told]))

    @cached_property
    def spread(self) -> float:
        """How far areas are from one another."""
        return float(self.left(np.ones(len(self.area))))

    @cached_property
    def _kinds(self) -> list[NDArray[np.intp]]:
        kinds = [np.flatnonzero(self.in_row), np.flatnonzero(~self.in_row)]
        return [kind for kind in kinds if len(kind) > FEWEST] or [np.arange(len(self.area))]

    @cached_property
    def _told(self) -> NDArray[np.intp]:
        return np.concatenate(self._kinds)


def _median(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Median (...) of values (..., m), the upper one of two: a third of the time of NumPy's, for few at a time."""
    middle = values.shape[-1] // 2
    return np.asarray(np.partition(values, middle, axis=-1)[..., middle])
