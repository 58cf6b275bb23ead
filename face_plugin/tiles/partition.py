"""Cut space into tiles: a k-d tree whose leaves hold about equally many points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Partition", "split"]


@dataclass(frozen=True)
class Partition:
    """Planes of a k-d tree. Node 0 is the root; a child c < 0 is the tile ``-1 - c``."""

    axis: NDArray[np.int64]
    """(k,) axis that the plane of each node is normal to."""
    threshold: NDArray[np.float64]
    """(k,) position of the plane; what is below it belongs to the left child."""
    child: NDArray[np.int64]
    """(k, 2) left and right child of each node."""

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return len(self.axis) + 1

    def assign(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Tile (n,) that owns each point (n, 3): by its position alone, so every part of a cloud agrees.

        Examples
        --------
        >>> line = np.arange(4.0)[:, None] * np.array([[1.0, 0, 0]])
        >>> split(line, 2).assign(line)
        array([0, 0, 1, 1])
        """
        node = np.zeros(len(points), dtype=np.int64) if len(self.axis) else np.full(len(points), -1)
        walking = np.flatnonzero(node >= 0)
        while len(walking):
            at = node[walking]
            right = points[walking, self.axis[at]] >= self.threshold[at]
            node[walking] = self.child[at, right.astype(np.int64)]
            walking = walking[node[walking] >= 0]
        return np.asarray(-1 - node)


def split(points: NDArray[np.float64], tiles: int) -> Partition:
    """Cut a cloud into `tiles` parts of equally many points, each time across its longest side.

    Parameters
    ----------
    points : (n, 3) float64
        The cloud, or a fair sample of it.
    tiles : int
        Number of tiles, at least 1. There are fewer where points share coordinates that no plane can part.

    Returns
    -------
    Partition

    Examples
    --------
    >>> split(np.random.default_rng(0).random((100, 3)), 5).tiles
    5
    """
    axes: list[int] = []
    thresholds: list[float] = []
    children: list[list[int]] = []
    leaves = 0

    def cut(rows: NDArray[np.intp], parts: int) -> int:
        nonlocal leaves
        plane = _plane(points[rows], parts) if parts > 1 else None
        if plane is None:
            leaves += 1
            return -leaves
        axis, threshold = plane
        node = len(axes)
        axes.append(axis)
        thresholds.append(threshold)
        children.append([0, 0])
        right = points[rows, axis] >= threshold
        children[node] = [cut(rows[~right], parts // 2), cut(rows[right], parts - parts // 2)]
        return node

    cut(np.arange(len(points)), tiles)
    return Partition(
        np.array(axes, dtype=np.int64), np.array(thresholds), np.array(children, dtype=np.int64).reshape(-1, 2)
    )


def _plane(points: NDArray[np.float64], parts: int) -> tuple[int, float] | None:
    """Plane with ``parts // 2`` of `parts` shares of the points below it; None where all points coincide."""
    extent = np.ptp(points, axis=0)
    axis = int(np.argmax(extent))
    if extent[axis] == 0:
        return None
    position = points[:, axis]
    rank = len(position) * (parts // 2) // parts
    threshold = float(np.partition(position, rank)[rank])
    if threshold == position.min():
        # Nothing would be below: many points share the lowest coordinate.
        threshold = float(position[position > threshold].min())
    return axis, threshold
