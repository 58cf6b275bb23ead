"""What the points alone say of the surface around them, before any orientation: sheets, plates, bulk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.fits import plane_fit
from face_plugin.thinning import thin

__all__ = ["Sheets", "back_to_back", "bulk", "find_sheets", "log_ramp", "neighbourhoods", "next_sheet", "ramp"]

# Neighbours among which the next sheet is looked for.
SHEET_NEIGHBOURS = 96
# A neighbour farther than this many spacings, within 37 degrees of the normal, belongs to another sheet.
SHEET_DISTANCE = 1.2
SHEET_COSINE = 0.8
# Neighbours whose extent across and along tells a sheet from a bar.
BULK_NEIGHBOURS = 12
# Points farther apart than this many spacings stand for all when the next sheet is looked for far away.
FAR_SPACING = 3.0
# A plate thinner than this many spacings: of PLATE_NEIGHBOURS at least PLATE_SHARE faces the other way, PLATE_BEHIND of
# those lies behind the point, PLATE_PARALLEL of all is parallel to within 45 degrees, for most points around.
PLATE_THICKNESS = 1.0
PLATE_NEIGHBOURS = 24
PLATE_SHARE = 0.25
PLATE_BEHIND = 0.9
PLATE_PARALLEL = 0.85
PLATE_MAJORITY = 0.4
SAME_LINE = 0.7


def neighbourhoods(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distances (n, k) to the points among which the next sheet is looked for, and their rows; a point itself first."""
    found = cKDTree(points).query(points, k=min(SHEET_NEIGHBOURS + 1, len(points)), workers=-1)
    return np.asarray(found[0]), np.asarray(found[1])


def bulk(points: NDArray[np.float64], neighbour: NDArray[np.intp]) -> NDArray[np.float64]:
    """Extent (n,) of the 12 nearest neighbours across the surface, relative to that along its narrower direction.

    The ratio of the two lower eigenvalues of their covariance: near 0 on a sheet, whatever its borders; near 1 where
    there is none, as in bars and rods thinner than the spacing, at corners, and where points scatter.

    Parameters
    ----------
    points : (n, 3) float64
    neighbour : (n, k) intp
        Nearest points, ascending, the point itself first.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(5.0), np.arange(5.0))
    >>> sheet = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    >>> float(bulk(sheet, cKDTree(sheet).query(sheet, k=13)[1]).max())
    0.0
    """
    near = points[neighbour[:, : BULK_NEIGHBOURS + 1]]
    offset = near - near.mean(axis=1, keepdims=True)
    low, middle, _ = np.linalg.eigvalsh(np.einsum("nki,nkj->nij", offset, offset)).T
    # Points on one line have no extent in either direction: as far from a sheet as can be.
    return np.asarray(np.where(middle > 0, np.maximum(low, 0.0) / np.where(middle > 0, middle, 1.0), 1.0))


def next_sheet(
    points: NDArray[np.float64],
    distance: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    spacing: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Distance (n,) from each point to the nearest other sheet of the surface, at most to its last neighbour.

    Needs no orientation: a neighbour along the normal, of either sign, lies on another sheet.
    """
    line = plane_fit(points, distance, neighbour, min(12, distance.shape[1] - 1), 1.0)
    reach = distance[:, -1].copy()
    for k in range(1, distance.shape[1]):
        along = np.abs(np.einsum("nd,nd->n", points[neighbour[:, k]] - points, line))
        hit = (along > SHEET_COSINE * distance[:, k]) & (distance[:, k] > SHEET_DISTANCE * spacing)
        np.minimum(reach, np.where(hit, distance[:, k], np.inf), out=reach)
    return np.asarray(reach)


def back_to_back(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    spacing: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Find the points (n,) of plates thinner than the spacing, which only the field can tell from noise.

    In a plate about half of the neighbours face the other way, and nearly all of those lie behind the point, as it
    lies behind them. Where points scatter about one sheet, few face the other way, and as many in front as behind. A
    point belongs to a plate where most of its neighbours have this pattern, so that a plate's rim does, too.
    """
    near = neighbour[:, 1 : PLATE_NEIGHBOURS + 1]
    facing = np.einsum("nkd,nd->nk", normals[near], normals)
    offset = points[near] - points[:, None]
    depth = -np.einsum("nkd,nd->nk", offset, normals)
    behind = (depth > 0) & (np.einsum("nkd,nkd->nk", offset, normals[near]) > 0)
    behind &= depth < PLATE_THICKNESS * spacing[:, None]
    opposite = facing < -SAME_LINE
    count = opposite.sum(axis=1)
    parallel = (np.abs(facing) > SAME_LINE).mean(axis=1)
    pattern = (
        (count >= PLATE_SHARE * near.shape[1])
        & ((opposite & behind).sum(axis=1) >= PLATE_BEHIND * count)
        & (parallel > PLATE_PARALLEL)
    )
    return np.asarray(pattern[near].mean(axis=1) > PLATE_MAJORITY)


@dataclass(frozen=True)
class Sheets:
    """Where points form sheets, and how far apart these are."""

    near: NDArray[np.float64]
    """(n,) distance to the next sheet, at most to the last neighbour looked at."""
    far: NDArray[np.float64]
    """(n,) the same, or farther where no sheet was among the neighbours."""
    bulk: NDArray[np.float64]
    """(n,) as `bulk` has it."""


def find_sheets(
    points: NDArray[np.float64], distance: NDArray[np.float64], neighbour: NDArray[np.intp]
) -> Sheets:
    """Look at the neighbours of each point, and farther where those see no other sheet.

    Strokes of a sketch are sampled densely and lie many spacings apart: among evenly spaced points, each `FAR_SPACING`
    spacings from the others, the same number of neighbours reaches so much farther.

    Parameters
    ----------
    points : (n, 3) float64
    distance, neighbour : (n, k) float64, (n, k) intp
        Of the nearest points, ascending, the point itself first; k > 6.

    Examples
    --------
    >>> from face_plugin.shapes import slab
    >>> plate = slab(2000, thickness=0.2).points
    >>> found = find_sheets(plate, *cKDTree(plate).query(plate, k=97))
    >>> bool(0.18 < np.median(found.near) < 0.3)
    True
    """
    spacing = distance[:, 1:7].mean(axis=1)
    near = next_sheet(points, distance, neighbour, spacing)
    few = points[thin(points, FAR_SPACING * spacing, seed=0)]
    far = near
    if len(few) > BULK_NEIGHBOURS:
        wide, among = cKDTree(few).query(few, k=min(distance.shape[1], len(few)), workers=-1)
        beyond = next_sheet(few, wide, among, wide[:, 1:7].mean(axis=1))[cKDTree(few).query(points, workers=-1)[1]]
        # What was found among the neighbours is nearer than anything that lies beyond them.
        far = np.where(near < distance[:, -1], near, np.maximum(near, beyond))
    return Sheets(near, far, bulk(points, neighbour))


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
