"""How far the points scatter about their surface: told from its shape by how residuals grow with the size of a fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.angles.fits import SIZES, LocalFits
from face_plugin.medians import medians

__all__ = ["find_noise", "on_lattice"]

# Coordinates are rounded where fewer than one in so many offsets to the nearest point differ, to this fraction of their
# median length.
OFFSETS = 20
ALIKE = 1e-3


def find_noise(
    points: NDArray[np.float64], fits: LocalFits, neighbour: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Variance (n,) of the points' noise, and that of what the smallest fits leave, in squared units of the points.

    Noise leaves the same residual variance at every size of a fit. A fold's grows as the square of the fit's radius,
    that is with the number of neighbours, and that of curvature faster. So the variance is extrapolated to a fit of no
    size, linearly in the number of neighbours, from the two smallest quadrics: the noise remains; folds and curvature
    give zero or less. Variances are medians over each point's neighbours, which edges and strays hardly move.

    Rounding to a lattice turns a slope into stairs, which are folds; what the smallest fits leave there is all noise.

    Parameters
    ----------
    points : (n, 3) float64
    fits : LocalFits
    neighbour : (n, k) intp
        Nearest points, the point itself first.

    Examples
    --------
    >>> from scipy.spatial import cKDTree
    >>> from face_plugin.angles.fits import fit_surfaces
    >>> rng = np.random.default_rng(0)
    >>> wall = np.stack([*rng.uniform(0, 20, (2, 400)), rng.normal(0, 0.1, 400)], axis=1)
    >>> near = cKDTree(wall).query(wall, k=97)[1]
    >>> noise, _ = find_noise(wall, fit_surfaces(wall, np.tile([0.0, 0, 1], (400, 1)), near), near)
    >>> bool(0.08 < np.sqrt(np.median(noise)) < 0.12)
    True
    """
    if len(fits.variance) == 0:
        return np.zeros(len(neighbour)), np.zeros(len(neighbour))
    least = medians(fits.variance[0, :, 1], neighbour)
    least = np.where(np.isfinite(least), least, 0.0)
    if on_lattice(points, neighbour):
        return least, least
    if len(fits.variance) == 1:
        return np.zeros(len(neighbour)), least
    larger = medians(fits.variance[1, :, 1], neighbour)
    small, large = SIZES[:2]
    noise = (large * least - small * np.where(np.isfinite(larger), larger, least)) / (large - small)
    return np.clip(noise, 0.0, least), least


def on_lattice(points: NDArray[np.float64], neighbour: NDArray[np.intp]) -> bool:
    """Whether the points' coordinates are rounded: the offsets (n, 3) to the nearest points are few and come again.

    Any rotation of the lattice is found as well; a regular sampling of a bent surface is none.

    Examples
    --------
    >>> from scipy.spatial import cKDTree
    >>> points = np.random.default_rng(0).uniform(0, 20, (2000, 3))
    >>> rounded = np.unique(points.round(), axis=0)
    >>> [on_lattice(p, cKDTree(p).query(p, k=2)[1]) for p in (points, rounded)]
    [False, True]
    """
    offset = points[neighbour[:, 1]] - points
    length = np.median(np.linalg.norm(offset, axis=1))
    steps = np.clip(np.rint(offset / (ALIKE * length)), -(2**19), 2**19).astype(np.int64)
    # One whole number an offset; that of the opposite one is its negative.
    key = np.sort(np.abs(steps @ np.array([1, 2**20, 2**40])))
    return bool(OFFSETS * np.count_nonzero(np.diff(key, prepend=-1)) < len(points))
