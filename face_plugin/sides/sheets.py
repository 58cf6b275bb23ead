"""What the points alone say of the surface around them, before any orientation: sheets, plates, bulk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.geometry import ramp, thin
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.planes import covariances, plane_fit
from face_plugin.threads import KDTree, in_threads

__all__ = ["Sheets", "back_to_back", "bulk", "cage_separation", "find_sheets", "next_sheet"]

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
# Smallest distance between balls, as a fraction of the distance to the 8th neighbour. Even samplings keep every point
# and so do both sides of a plate down to 0.4 spacings; near-duplicates of registered scans go.
DUPLICATE = 0.35
# On a sheet, as a fraction of the distance to the next one, at most so many spacings and so much of the longest side.
COARSENING = 0.3
COARSEST = 4.0
COARSEST_SHARE = 0.04
# A sheet is where `bulk` is below these values, fully and not at all.
CAGE_SHEET = (0.02, 0.1)
# Neighbours among which the least favourable quarter decides.
CAGE_AROUND = 12
# Fewer points than this have no 8th neighbour.
FEWEST = 9


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
    >>> float(bulk(sheet, KDTree(sheet).query(sheet, k=13)[1]).max())
    0.0
    """
    near = neighbour[:, : BULK_NEIGHBOURS + 1]
    low, middle = np.linalg.eigvalsh(covariances(points, near, np.ones(near.shape))).T[:2]
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
    reach = np.empty(len(points))
    _first_along(points, line, np.ascontiguousarray(distance), np.ascontiguousarray(neighbour), spacing, reach)
    return reach


@compiled()
def _first_along(points, line, distance, neighbour, spacing, reach):  # type: ignore[no-untyped-def]
    last = distance.shape[1] - 1
    for i in range(len(points)):
        reach[i] = distance[i, last]
        for k in range(1, last):
            far = distance[i, k]
            if far > SHEET_DISTANCE * spacing[i]:
                j = neighbour[i, k]
                along = (
                    (points[j, 0] - points[i, 0]) * line[i, 0]
                    + (points[j, 1] - points[i, 1]) * line[i, 1]
                    + (points[j, 2] - points[i, 2]) * line[i, 2]
                )
                if abs(along) > SHEET_COSINE * far:
                    reach[i] = far
                    break


def back_to_back(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find the points (n,) of plates thinner than the spacing, which only the field can tell from noise.

    In a plate about half of the neighbours face the other way, and nearly all of those lie behind the point, as it
    lies behind them. Where points scatter about one sheet, few face the other way, and as many in front as behind. A
    point belongs to a plate where most of its neighbours have this pattern, so that a plate's rim does, too.
    """
    pattern = np.empty(len(around), dtype=np.bool_)
    near = np.ascontiguousarray(around.neighbour[:, 1 : PLATE_NEIGHBOURS + 1])
    points, normals = around.points, np.ascontiguousarray(normals)
    thick = PLATE_THICKNESS * around.spacing

    def run(rows: slice) -> None:
        _in_pattern(rows.start, rows.stop, points, normals, near, thick, pattern)

    in_threads(run, len(around))
    return np.asarray(pattern[near].mean(axis=1) > PLATE_MAJORITY)


@compiled(nogil=True)
def _in_pattern(first, last, points, normals, near, thick, pattern):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        opposite, behind, parallel = 0, 0, 0
        for k in range(near.shape[1]):
            j = near[i, k]
            facing, depth, height = 0.0, 0.0, 0.0
            for d in range(3):
                offset = points[j, d] - points[i, d]
                facing += normals[j, d] * normals[i, d]
                depth -= offset * normals[i, d]
                height += offset * normals[j, d]
            parallel += abs(facing) > SAME_LINE
            if facing < -SAME_LINE:
                opposite += 1
                behind += 0.0 < depth < thick[i] and height > 0.0
        pattern[i] = (
            opposite >= PLATE_SHARE * near.shape[1]
            and behind >= PLATE_BEHIND * opposite
            and parallel > PLATE_PARALLEL * near.shape[1]
        )


@dataclass(frozen=True)
class Sheets:
    """Where points form sheets, and how far apart these are."""

    near: NDArray[np.float64]
    """(n,) distance to the next sheet, at most to the last neighbour looked at."""
    far: NDArray[np.float64]
    """(n,) the same, or farther where no sheet was among the neighbours."""
    bulk: NDArray[np.float64]
    """(n,) as `bulk` has it."""


def find_sheets(around: Neighbourhood) -> Sheets:
    """Look at the neighbours of each point, and farther where those see no other sheet.

    Strokes of a sketch are sampled densely and lie many spacings apart: among evenly spaced points, each `FAR_SPACING`
    spacings from the others, the same number of neighbours reaches so much farther.

    Examples
    --------
    >>> from face_plugin.shapes import slab
    >>> found = find_sheets(Neighbourhood(slab(2000, thickness=0.2).points))
    >>> bool(0.18 < np.median(found.near) < 0.3)
    True
    """
    points, distance, spacing = around.points, around.distance, around.spacing
    near = next_sheet(points, distance, around.neighbour, spacing)
    few = points[thin(points, FAR_SPACING * spacing, seed=0, found=(distance, around.neighbour))]
    far = near
    if len(few) > BULK_NEIGHBOURS:
        wide = Neighbourhood(few)
        beyond = next_sheet(few, wide.distance, wide.neighbour, wide.spacing)
        beyond = beyond[KDTree(few).query(points)[1]]
        # What was found among the neighbours is nearer than anything that lies beyond them.
        far = np.where(near < distance[:, -1], near, np.maximum(near, beyond))
    return Sheets(near, far, bulk(points, around.neighbour))


def cage_separation(
    around: Neighbourhood, cage_spacing: float | None, *, coarsen: bool = True
) -> tuple[NDArray[np.float64], Sheets | None]:
    """Smallest distance (n,) between balls at each point, in the points' unit.

    Parameters
    ----------
    around : Neighbourhood
        Of the points in the canonical frame, whose longest side is 1.
    cage_spacing : float or None
        The same for all, in the points' unit. None = the larger of two, and 0 for fewer points than 9:
        0.35 x the distance to the 8th neighbour, which removes near-duplicates and keeps even samplings; and, on
        sheets, 0.3 x the distance to the next one, at most 4 spacings and at most 0.04. A coarse cage bridges gaps
        as wide as its own spacing; and where nothing else is near, its side of the sheet is as right as a fine one's.
    coarsen : bool
        Whether None may do the second. The angles of a coarse cage's field are coarse as well.

    Returns
    -------
    separation : (n,) float64
    sheets : Sheets or None
        Of the points, where they were looked for.

    Examples
    --------
    >>> cage_separation(Neighbourhood(np.eye(3)), 0.1)[0]
    array([0.1, 0.1, 0.1])
    """
    points = around.points
    if cage_spacing is not None:
        return np.full(len(points), cage_spacing), None
    if len(points) < FEWEST:
        return np.zeros(len(points)), None
    if not coarsen:
        return DUPLICATE * KDTree(points).query(points, k=[9])[0][:, 0], None
    sheets = find_sheets(around)
    # A point is as exposed to another sheet, and as little on one itself, as its surroundings are.
    near = around.neighbour[:, : CAGE_AROUND + 1]
    reach = np.percentile(sheets.far[near], 25.0, axis=1)
    on_sheet = 1.0 - np.percentile(ramp(sheets.bulk, CAGE_SHEET)[near], 75.0, axis=1)
    coarsest = np.minimum(COARSEST * around.spacing, COARSEST_SHARE)
    coarse = np.minimum(COARSENING * reach * on_sheet, coarsest)
    return np.asarray(np.maximum(DUPLICATE * around.distance[:, 8], coarse)), sheets
