"""Points and vectors: neighbours, spacing, planes, even subsets; what several rooms need and none owns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.threads import KDTree

__all__ = ["evenly", "lattice", "local_spacing", "log_ramp", "ramp", "thin", "unit"]


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors (k, d) at length one; a zero vector becomes the last axis.

    Examples
    --------
    >>> unit(np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 0.0]]))
    array([[0., 1., 0.],
           [0., 0., 1.]])
    """
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0, vectors / np.where(length > 0, length, 1.0), np.eye(vectors.shape[1])[-1])


def evenly(n: int, count: int) -> NDArray[np.intp]:
    """At most `count` of n rows, ascending, as far apart as they can be.

    Examples
    --------
    >>> evenly(9, 3)
    array([0, 4, 8])
    """
    return np.unique(np.linspace(0, n - 1, count).astype(np.intp))


def lattice(wide: int) -> NDArray[np.float64]:
    """Places (wide^3, 3) of a lattice over the cube from -1 to 1.

    Examples
    --------
    >>> lattice(2).shape
    (8, 3)
    """
    return np.stack(np.meshgrid(*3 * [np.linspace(-1.0, 1.0, wide)], indexing="ij"), axis=-1).reshape(-1, 3)


def local_spacing(points: NDArray[np.float64], neighbours: int = 6) -> NDArray[np.float64]:
    """Mean distance of each point (n, d) to its nearest `neighbours` others, in the points' unit.

    Examples
    --------
    >>> local_spacing(np.arange(3.0)[:, None] * np.array([[1.0, 0, 0]]), 1)
    array([1., 1., 1.])
    """
    k = min(neighbours, len(points) - 1)
    distance, _ = KDTree(points).query(points, k=k + 1)
    return np.asarray(distance[:, 1:].mean(axis=1))


def ramp(values: NDArray[np.float64], ends: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """0 at the first end, 1 at the second, linear between.

    Examples
    --------
    >>> ramp(np.array([0.0, 0.25, 2.0]), (0.0, 1.0))
    array([0.  , 0.25, 1.  ])
    """
    return np.asarray(np.clip((values - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0))


def log_ramp(strength: NDArray[np.float64], ends: Sequence[float]) -> NDArray[np.float64]:
    """0 at the first end, 1 at the second, linear between in the logarithm: for E_max, which spans many decades.

    Examples
    --------
    >>> log_ramp(np.array([0.0, 1.0, 10.0]), (0.1, 10.0))
    array([0. , 0.5, 1. ])
    """
    return ramp(np.log(np.maximum(strength, 1e-9)), np.log(ends))


def thin(
    points: NDArray[np.float64],
    separation: NDArray[np.float64],
    seed: int,
    found: tuple[NDArray[np.float64], NDArray[np.intp]] | None = None,
) -> NDArray[np.intp]:
    """Take a Poisson-disk subset: points in random order, each unless one within its separation was taken.

    Parameters
    ----------
    points : (n, 3) float64
    separation : (n,) float64, in the points' unit
    seed : int
    found : ((n, k) float64, (n, k) intp), optional
        Distances and rows of the nearest points, ascending, where they are known: only where they do not reach as far
        as the separation others are searched for.

    Returns
    -------
    (k,) intp
        Rows of the points taken, ascending. Every point has one of them within its separation.

    Examples
    --------
    >>> line = np.arange(4.0)[:, None] * np.array([[1.0, 0, 0]])
    >>> len(thin(line, np.full(4, 0.5), seed=0))
    4
    """
    order = np.random.default_rng(seed).permutation(len(points))
    if separation.max() <= 0:
        return np.arange(len(points))
    # A point exactly as far away as the separation is far enough, whatever rounding says.
    within = separation * (1 - 1e-12)
    if found is None:
        beyond = np.flatnonzero(KDTree(points).query(points, k=2)[0][:, 1] < separation)
        found = np.empty((len(points), 0)), np.empty((len(points), 0), dtype=np.intp)
    else:
        beyond = np.flatnonzero((found[0][:, -1] <= within) & (found[0].shape[1] < len(points)))
    start, others = np.zeros(len(points) + 1, dtype=np.int64), np.empty(0, dtype=np.int64)
    if len(beyond):
        lists = KDTree(points).within(points[beyond], within[beyond])
        start[beyond + 1] = [len(x) for x in lists]
        np.cumsum(start, out=start)
        others = np.concatenate([np.asarray(x, dtype=np.int64) for x in lists])
    taken = np.zeros(len(points), dtype=np.bool_)
    _greedy(order, within, *map(np.ascontiguousarray, found), start, others, taken)
    return np.flatnonzero(taken)


@compiled()
def _greedy(order, within, distance, neighbour, start, others, taken):  # type: ignore[no-untyped-def]
    """Take points in their order, each unless one of its neighbours was taken: those listed, and the nearest."""
    for k in range(len(order)):
        i = order[k]
        free = True
        for j in range(start[i], start[i + 1]):
            if taken[others[j]]:
                free = False
                break
        for j in range(distance.shape[1]):
            if not free or distance[i, j] > within[i]:
                break
            if taken[neighbour[i, j]]:
                free = False
        taken[i] = free
