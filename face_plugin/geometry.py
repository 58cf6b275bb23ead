"""Points and vectors: neighbours, spacing, planes, even subsets; what several rooms need and none owns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.threads import KDTree

__all__ = ["local_spacing", "log_ramp", "plane_fit", "plane_fits", "ramp", "thin", "unit"]


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


def plane_fit(
    points: NDArray[np.float64],
    distance: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    count: int,
    width: float,
) -> NDArray[np.float64]:
    """Fit planes: unit normals (n, 3), of either sign; arguments as of `plane_fits`.

    Examples
    --------
    >>> flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> from face_plugin.threads import KDTree
    >>> abs(plane_fit(flat, *KDTree(flat).query(flat, k=4), count=3, width=1.0)[0]).round(6)
    array([0., 0., 1.])
    """
    return plane_fits(points, distance, neighbour, count, width)[0]


def plane_fits(
    points: NDArray[np.float64],
    distance: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    count: int,
    width: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit a plane to each point's `count` nearest neighbours.

    Weights are Gaussian, of `width` times the mean distance to those neighbours.

    Parameters
    ----------
    points : (n, 3) float64
    distance, neighbour : (n, k) float64, (n, k) intp
        Of the nearest points, ascending, the point itself first; k > count.

    Returns
    -------
    lines : (n, 3) float64
        Unit normals of the planes, of either sign.
    flatness : (n,) float64
        1 less the ratio of the two lower eigenvalues of the covariance: 1 on a plane, 0 where there is none.

    Examples
    --------
    >>> flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> from face_plugin.threads import KDTree
    >>> plane_fits(flat, *KDTree(flat).query(flat, k=4), count=3, width=1.0)[1].round(6)
    array([1., 1., 1., 1.])
    """
    distance, neighbour = distance[:, : count + 1], neighbour[:, : count + 1]
    scale = width * distance[:, 1:].mean(axis=1, keepdims=True)
    weight = np.exp(-((distance / scale) ** 2))
    weight /= weight.sum(axis=1, keepdims=True)
    offset = points[neighbour]
    offset -= np.einsum("nk,nkd->nd", weight, offset)[:, None]
    covariance = np.einsum("nk,nki,nkj->nij", weight, offset, offset)
    variance, axes = np.linalg.eigh(covariance)
    middle = np.maximum(variance[:, 1], np.finfo(float).tiny)
    return np.ascontiguousarray(axes[:, :, 0]), np.clip(1.0 - variance[:, 0] / middle, 0.0, 1.0)


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
        Distances and rows of the nearest points, ascending, where they are known: saves a search, as long as they
        reach as far as the separation.

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
    taken = np.zeros(len(points), dtype=np.bool_)
    # A point exactly as far away as the separation is far enough, whatever rounding says.
    within = separation * (1 - 1e-12)
    if found is not None and (found[0].shape[1] == len(points) or (found[0][:, -1] > within).all()):
        _greedy_among(order, within, np.ascontiguousarray(found[0]), np.ascontiguousarray(found[1]), taken)
        return np.flatnonzero(taken)
    tree = KDTree(points)
    nearest = tree.query(points, k=2)[0][:, 1]
    crowded = np.flatnonzero(nearest < separation)
    if len(crowded) == 0:
        return np.arange(len(points))
    lists = tree.within(points[crowded], within[crowded])
    length = np.fromiter((len(x) for x in lists), dtype=np.int64, count=len(lists))
    start = np.zeros(len(points) + 1, dtype=np.int64)
    start[crowded + 1] = length
    np.cumsum(start, out=start)
    neighbour = np.concatenate([np.asarray(x, dtype=np.int64) for x in lists])
    _greedy(order, start, neighbour, taken)
    return np.flatnonzero(taken)


@compiled()
def _greedy(order, start, neighbour, taken):  # type: ignore[no-untyped-def]
    """Take points in their order, each unless one of its neighbours was taken."""
    for k in range(len(order)):
        i = order[k]
        free = True
        for j in range(start[i], start[i + 1]):
            if taken[neighbour[j]]:
                free = False
                break
        taken[i] = free


@compiled()
def _greedy_among(order, within, distance, neighbour, taken):  # type: ignore[no-untyped-def]
    """Do the same by a table of neighbours, as far as each point's separation."""
    for k in range(len(order)):
        i = order[k]
        free = True
        for j in range(distance.shape[1]):
            if distance[i, j] > within[i]:
                break
            if taken[neighbour[i, j]]:
                free = False
                break
        taken[i] = free
