"""What a Poisson reconstruction needs: the depth that the points bear, and the memory that it takes."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.memory import GIGABYTE, available_memory

__all__ = ["reconstruction_memory", "suggested_depth", "warn_if_too_large"]

log = logging.getLogger(__name__)

# The octree's cube is this many times as large as the points' longest side (Open3D's and PyMeshLab's
# default).
SCALE = 1.1
# Depths suggested: below, nothing is left of most shapes; above, faces number in the hundreds of millions.
SUGGESTED = (5, 12)
# Points whose spacing is looked at.
PROBES = 2_000
# Measured with Open3D and PyMeshLab on spheres of 20k and 200k points at depths 7 to 10 (docs/scaling.md):
# bytes for a finest cell with points in it, and the further share for each level below the spacing.
CELL_BYTES = 1.5e3
DEEPER_SHARE = 0.6
_BITS = 20


def suggested_depth(points: NDArray[np.floating]) -> int:
    """Depth of the octree whose finest cell is as wide as the spacing of the points, from 5 to 12.

    Parameters
    ----------
    points : (n, 3) float, in any unit

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> suggested_depth(sphere(2000).points)
    5
    """
    depth = round(_resolved_depth(points))
    return min(max(depth, SUGGESTED[0]), SUGGESTED[1])


def _resolved_depth(points: NDArray[np.floating]) -> float:
    """Depth, as a real number, at which a cell is as wide as the median distance to the 6 nearest."""
    probes = points[:: max(1, len(points) // PROBES)]
    distance = cKDTree(points).query(probes, k=min(7, len(points)), workers=-1)[0]
    spacing = float(np.median(distance[:, 1:].mean(axis=1)))
    longest = float(np.ptp(points, axis=0).max())
    return float(np.log2(SCALE * longest / spacing)) if spacing > 0 else float(SUGGESTED[1])


def reconstruction_memory(points: NDArray[np.floating], depth: int) -> float:
    """Bytes that a reconstruction takes, within a factor of about 1.5.

    Parameters
    ----------
    points : (n, 3) float, in any unit
    depth : int
    """
    cell = SCALE * float(np.ptp(points, axis=0).max()) / 2 ** min(depth, _BITS)
    index = ((points - points.min(axis=0)) / cell).astype(np.int64)
    occupied = len(np.unique((index[:, 0] << 2 * _BITS) | (index[:, 1] << _BITS) | index[:, 2]))
    return CELL_BYTES * occupied * (1.0 + DEEPER_SHARE * max(0.0, depth - _resolved_depth(points)))


def warn_if_too_large(points: NDArray[np.floating], depth: int) -> None:
    """Log a warning, with numbers, before a reconstruction that does not fit into the memory that is free."""
    needed, free = reconstruction_memory(points, depth), available_memory()
    if needed > free:
        log.warning(
            "a reconstruction of depth %d from %d points takes about %.3g GB, and %.3g GB are free: it may be killed; "
            "the points bear a depth of %d, and each level less takes about a quarter",
            depth,
            len(points),
            needed / GIGABYTE,
            free / GIGABYTE,
            suggested_depth(points),
        )
