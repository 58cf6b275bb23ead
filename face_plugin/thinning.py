"""Even subsets of points: no two nearer than a given distance (Poisson-disk elimination)."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

__all__ = ["thin"]


def thin(
    points: NDArray[np.float64], separation: NDArray[np.float64], seed: int
) -> NDArray[np.intp]:
    """Take a Poisson-disk subset: points in random order, each unless one within its separation was taken.

    Parameters
    ----------
    points : (n, 3) float64
    separation : (n,) float64, in the points' unit
    seed : int

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
    cell = float(separation.max())
    if cell <= 0:
        return np.arange(len(points))
    tree = cKDTree(points)
    nearest = tree.query(points, k=2, workers=-1)[0][:, 1]
    crowded = np.flatnonzero(nearest < separation)
    taken = np.ones(len(points), dtype=np.bool_)
    if len(crowded) == 0:
        return np.flatnonzero(taken)
    lists = tree.query_ball_point(points[crowded], separation[crowded] * (1 - 1e-12), workers=-1)
    length = np.fromiter((len(x) for x in lists), dtype=np.int64, count=len(lists))
    start = np.zeros(len(points) + 1, dtype=np.int64)
    start[crowded + 1] = length
    np.cumsum(start, out=start)
    neighbour = np.concatenate([np.asarray(x, dtype=np.int64) for x in lists])
    return np.flatnonzero(_greedy(order, start, neighbour))


@numba.njit(cache=True)
def _greedy(
    order: NDArray[np.intp], start: NDArray[np.int64], neighbour: NDArray[np.int64]
) -> NDArray[np.bool_]:
    taken = np.zeros(len(order), dtype=np.bool_)
    for i in order:
        free = True
        for k in range(start[i], start[i + 1]):
            if taken[neighbour[k]]:
                free = False
                break
        taken[i] = free
    return taken
