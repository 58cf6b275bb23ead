"""What is near each point of a cloud: found once, and handed from step to step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from face_plugin.tree import PointTree
from face_plugin.winding import DipoleTree
from face_plugin.winding_plane import PlaneTree

__all__ = ["Neighbourhood"]

# Neighbours looked at around a point: enough to see the next sheet of the surface.
NEIGHBOURS = 96
# Nearest neighbours whose mean distance is the spacing.
SPACING_NEIGHBOURS = 6


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """The neighbours of each point, the spacing, and the tree of dipoles; each is found when first asked for.

    Examples
    --------
    >>> around = Neighbourhood(np.arange(3.0)[:, None] * np.array([[1.0, 0, 0]]))
    >>> around.spacing, around.neighbour[0]
    (array([1.5, 1. , 1.5]), array([0, 1, 2]))
    """

    points: NDArray[np.float64]
    """(n, d) distinct; in Morton order for speed. d is 3, or 2 in the plane."""

    def __len__(self) -> int:
        """Return the number n of points."""
        return len(self.points)

    @property
    def plane(self) -> bool:
        """Whether the points lie in the plane, on curves, and not in space, on surfaces."""
        return bool(self.points.shape[1] == 2)

    @cached_property
    def _halved(self) -> PointTree:
        return PointTree(self.points)

    @cached_property
    def _found(self) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        return self._halved.nearest(min(NEIGHBOURS + 1, len(self.points)))

    @property
    def distance(self) -> NDArray[np.float64]:
        """Distances (n, k) to the nearest points, ascending, the point itself first; k is 97, or n."""
        return self._found[0]

    @property
    def neighbour(self) -> NDArray[np.intp]:
        """Rows (n, k) of the nearest points."""
        return self._found[1]

    @cached_property
    def spacing(self) -> NDArray[np.float64]:
        """Mean distance (n,) to the 6 nearest other points."""
        return np.asarray(self.distance[:, 1 : SPACING_NEIGHBOURS + 1].mean(axis=1))

    @cached_property
    def tree(self) -> DipoleTree:
        """Dipoles at the points, each of the area of a square as wide as the spacing; on a curve, of a length."""
        if self.plane:
            # Within the distance to the last of the 6 nearest there is twice that of curve, however points are spread.
            count = min(SPACING_NEIGHBOURS, self.distance.shape[1] - 1)
            return PlaneTree(self._halved, 2.0 / count * self.distance[:, count])
        return DipoleTree(self._halved, self.spacing**2)
