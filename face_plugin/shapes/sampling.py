"""Even (Poisson-disk) subsets of points, deterministic by seed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

OVERSAMPLING = 6
"""Uniform candidates a kept point: more is more even and slower, and past six little is gained."""

# Disks of diameter r hold 0.70 / r^2 points a unit of area and six candidates a point reach most of it.
_DENSITY = 0.61
_ROUNDS = 12


def _darts(
    points: NDArray[np.float64], rank: NDArray[np.int64], radius: float, normals: NDArray[np.float64] | None
) -> NDArray[np.int64]:
    """Throw the points in order of `rank`, keeping each that has no kept one within `radius`."""
    pairs = cKDTree(points).query_pairs(radius, output_type="ndarray")
    if normals is not None:
        # Two sides of a thin wall are two surfaces: they do not crowd one another.
        pairs = pairs[np.einsum("ij,ij->i", normals[pairs[:, 0]], normals[pairs[:, 1]]) > -0.2]
    swap = rank[pairs[:, 0]] > rank[pairs[:, 1]]
    first = np.where(swap, pairs[:, 1], pairs[:, 0])
    later = np.where(swap, pairs[:, 0], pairs[:, 1])
    kept = np.zeros(len(points), dtype=bool)
    open_ = np.ones(len(points), dtype=bool)
    # Whoever waits for no earlier neighbour is kept, whoever has a kept neighbour is out: the same outcome as
    # going through the points one by one, in about log(n) vectorised rounds.
    while open_.any():
        waiting = np.zeros(len(points), dtype=bool)
        waiting[later] = True
        new = open_ & ~waiting
        kept |= new
        open_ &= ~new
        open_[later[new[first]]] = False
        alive = open_[first] & open_[later]
        first, later = first[alive], later[alive]
    return np.flatnonzero(kept)


def _trim(points: NDArray[np.float64], kept: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Remove the most crowded points until `n` are left."""
    while len(kept) > n:
        distance, index = cKDTree(points[kept]).query(points[kept], k=2)
        partner = index[:, 1]
        # Of two mutual neighbours only one may go in a pass.
        removable = (partner[partner] != np.arange(len(kept))) | (np.arange(len(kept)) < partner)
        candidates = np.flatnonzero(removable)
        worst = candidates[np.argsort(distance[candidates, 1], kind="stable")[: len(kept) - n]]
        kept = np.delete(kept, worst)
    return kept


def apart(points: ArrayLike, radius: float, rng: np.random.Generator) -> NDArray[np.int64]:
    """Choose points in random order so that no two are within `radius` of one another, as many as fit.

    Parameters
    ----------
    points
        (m, 3).
    radius
        In their unit, above 0.
    rng
        Its state decides the outcome.

    Returns
    -------
    (n,) int64, ascending indices into `points`.

    Examples
    --------
    >>> import numpy as np
    >>> line = np.arange(9)[:, None] * [0.1, 0.0, 0.0]
    >>> len(apart(line, 0.05, np.random.default_rng(0)))
    9
    """
    candidates = np.asarray(points, dtype=np.float64)
    return _darts(candidates, rng.permutation(len(candidates)), radius, None)


def evenly(
    points: ArrayLike, n: int, rng: np.random.Generator, *, normals: NDArray[np.float64] | None = None
) -> NDArray[np.int64]:
    """Choose `n` evenly spread points of a dense random sample of a surface.

    Darts are thrown in random order at a radius found by iteration; what is left over of the count goes by
    removing the most crowded points.

    Parameters
    ----------
    points
        (m, 3) candidates, uniform over the surface, best `OVERSAMPLING` times `n` or more.
    n
        How many to keep, 1 to m.
    rng
        Its state decides the outcome.
    normals
        (m, 3) unit normals; with them the two sides of a wall thinner than the spacing are spread separately.

    Returns
    -------
    (n,) int64, ascending indices into `points`.

    Raises
    ------
    ValueError
        `n` is not in 1 to m, or `points` is not (m, 3).

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> len(evenly(rng.random((600, 3)), 100, rng))
    100
    """
    candidates = np.asarray(points, dtype=np.float64)
    if candidates.ndim != 2 or candidates.shape[1] != 3:
        raise ValueError(f"points: found shape {candidates.shape}, allowed is (m, 3)")
    m = len(candidates)
    if not 1 <= n <= m:
        raise ValueError(f"n: found {n}, allowed is 1 to the number of points, {m}")
    if n == m:
        return np.arange(m)
    rank = rng.permutation(m)
    nearest = cKDTree(candidates).query(candidates, k=2)[0][:, 1]
    # Uniform points in the plane: mean nearest distance is half the root of the area a point.
    area = 4.0 * m * float(nearest.mean()) ** 2
    radius = float(np.sqrt(_DENSITY * area / n))
    best: NDArray[np.int64] | None = None
    for _ in range(_ROUNDS):
        kept = _darts(candidates, rank, radius, normals)
        if len(kept) >= n and (best is None or len(kept) < len(best)):
            best = kept
        if n <= len(kept) <= 1.015 * n + 1:
            break
        radius *= float(np.sqrt(len(kept) / (1.006 * n)))
    if best is None:
        # Many candidates coincide: no radius keeps enough, so take the rest in random order.
        rest = np.setdiff1d(np.arange(m), kept)
        best = np.concatenate([kept, rest[np.argsort(rank[rest])][: n - len(kept)]])
    return np.sort(_trim(candidates, best, n))
