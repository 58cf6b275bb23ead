"""`Shape`: a cloud with its truth, made from solids; noise and outliers on top."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.shapes.sampling import OVERSAMPLING, evenly
from face_plugin.shapes.solids import Solid

_ROUNDING = 1e-9  # lengths are of order one


@dataclass(frozen=True)
class Shape:
    """A cloud and what is true of it.

    Attributes
    ----------
    points
        (n, 3) float64.
    normals
        (n, 3) float64, unit, outward of the solid that a point was drawn from; NaN for outliers.
    interior
        (n,) bool: strictly inside the union of the solids, deeper than rounding.
    depth
        (n,) float64: distance of an interior point to the outer surface, measured to a sample `OVERSAMPLING`
        times as dense as the cloud (too large by less than half the spacing); 0 for the others,
        NaN for outliers.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    interior: NDArray[np.bool_]
    depth: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.points)


def from_solids(solids: Sequence[Solid], n: int, seed: int = 0, *, together: bool = True) -> Shape:
    """Sample the surfaces of overlapping solids evenly, the parts inside one another included.

    Parameters
    ----------
    solids
        At least one.
    n
        Number of points, at least 1.
    seed
        Of the random numbers.
    together
        Spread the points of all solids in one go, so that none are close where solids cross. False spreads
        each on its own (two scans of one surface).

    Raises
    ------
    ValueError
        `n` is below 1 or `solids` is empty.

    Examples
    --------
    >>> from face_plugin.shapes.solids import ball
    >>> shape = from_solids([ball(1.0), ball(1.0).moved((1.0, 0.0, 0.0))], 500)
    >>> bool(shape.interior.any())
    True
    """
    if n < 1:
        raise ValueError(f"n: found {n}, allowed is 1 or more")
    if not solids:
        raise ValueError("solids: found none, allowed is one or more")
    rng = np.random.default_rng(seed)
    share = np.cumsum([solid.area for solid in solids])
    quota = np.diff(np.rint(share / share[-1] * n).astype(int), prepend=0)
    drawn = [solid.sample(OVERSAMPLING * int(k), rng) for solid, k in zip(solids, quota, strict=True)]
    points, normals = (np.concatenate(arrays) for arrays in zip(*drawn, strict=True))
    owner = np.repeat(np.arange(len(solids)), OVERSAMPLING * quota)
    interior = np.zeros(len(points), dtype=bool)
    for k, solid in enumerate(solids):
        interior |= (owner != k) & (solid.level(points) < -_ROUNDING)
    if together:
        kept = evenly(points, n, rng, normals=normals)
    else:
        parts = [np.flatnonzero(owner == k) for k in range(len(solids)) if quota[k]]
        kept = np.concatenate([p[evenly(points[p], len(p) // OVERSAMPLING, rng, normals=normals[p])] for p in parts])
    depth = np.zeros(n)
    inside = interior[kept]
    if inside.any():
        depth[inside] = cKDTree(points[~interior]).query(points[kept[inside]])[0]
    return Shape(points[kept], normals[kept], inside, depth)


def with_noise(shape: Shape, sigma: float, seed: int = 0) -> Shape:
    """Return the shape with independent Gaussian noise of standard deviation `sigma` on every coordinate.

    The truth stays that of the points before they were moved.

    Raises
    ------
    ValueError
        `sigma` is negative.

    Examples
    --------
    >>> from face_plugin import shapes
    >>> noisy = with_noise(shapes.sphere(100), 0.01)
    """
    if sigma < 0:
        raise ValueError(f"sigma: found {sigma}, allowed is 0 or more")
    noise = np.random.default_rng(seed).normal(scale=sigma, size=shape.points.shape)
    return replace(shape, points=shape.points + noise)


def with_outliers(shape: Shape, fraction: float, seed: int = 0) -> Shape:
    """Return the shape with stray points appended, uniform in its bounding box enlarged by a quarter.

    A stray point has no truth: its normal and depth are NaN, its interior flag is False.

    Parameters
    ----------
    shape
        Left as it is.
    fraction
        Stray points over the shape's own.
    seed
        Of the random numbers.

    Raises
    ------
    ValueError
        `fraction` is negative.

    Examples
    --------
    >>> from face_plugin import shapes
    >>> len(with_outliers(shapes.sphere(100), 0.1))
    110
    """
    if fraction < 0:
        raise ValueError(f"fraction: found {fraction}, allowed is 0 or more")
    count = round(fraction * len(shape))
    low, high = shape.points.min(axis=0), shape.points.max(axis=0)
    stray = (low + high) / 2 + (np.random.default_rng(seed).random((count, 3)) - 0.5) * 1.25 * (high - low)
    return Shape(
        np.concatenate([shape.points, stray]),
        np.concatenate([shape.normals, np.full((count, 3), np.nan)]),
        np.concatenate([shape.interior, np.zeros(count, dtype=bool)]),
        np.concatenate([shape.depth, np.full(count, np.nan)]),
    )
