"""The Faraday cage: a small conducting ball at each point, as a platonic solid (paper section 3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.sheets import Sheets, find_sheets, neighbourhoods, ramp

__all__ = ["Balls", "build_balls", "local_spacing", "separation"]

# Smallest distance between balls, as a fraction of the distance to the 8th neighbour. Even samplings keep every point
# and so do both sides of a plate down to 0.4 spacings; near-duplicates of registered scans go.
THINNING = 0.35
# On a sheet, as a fraction of the distance to the next one, at most so many spacings and so much of the longest side.
COARSENING = 0.3
COARSEST = 4.0
WIDEST = 0.04
# A sheet is where `bulk` is below these values, fully and not at all.
SHEET = (0.02, 0.1)
# Neighbours among which the least favourable quarter decides.
AROUND = 12
# Fewer points than this have no 8th neighbour.
FEWEST = 9

Solid = Literal["octahedron", "icosahedron"]


def _icosahedron() -> NDArray[np.float64]:
    golden = (1 + 5**0.5) / 2
    short = [(0.0, a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    vertices = np.array([np.roll(v, k) for k in range(3) for v in short])
    return np.asarray(vertices / np.linalg.norm(vertices[0]))


SOLIDS: dict[str, NDArray[np.float64]] = {
    "octahedron": np.concatenate([np.eye(3), -np.eye(3)]),
    "icosahedron": _icosahedron(),
}


@dataclass(frozen=True)
class Balls:
    """The conductor: disjoint balls in the canonical frame."""

    points: NDArray[np.intp]
    """(b,) row of the cloud's point at the centre of each ball."""
    centres: NDArray[np.float64]
    """(b, 3) centres."""
    radii: NDArray[np.float64]
    """(b,) radii; no two balls touch."""
    vertices: NDArray[np.float64]
    """(b, s, 3) vertices of each ball, on its sphere."""


def local_spacing(points: NDArray[np.float64], neighbours: int = 6) -> NDArray[np.float64]:
    """Mean distance of each point (n, 3) to its nearest `neighbours` others, in the points' unit.

    Examples
    --------
    >>> local_spacing(np.arange(3.0)[:, None] * np.array([[1.0, 0, 0]]), 1)
    array([1., 1., 1.])
    """
    k = min(neighbours, len(points) - 1)
    distance, _ = cKDTree(points).query(points, k=k + 1, workers=-1)
    return np.asarray(distance[:, 1:].mean(axis=1))


def separation(
    points: NDArray[np.float64], cage_spacing: float | None, *, coarsen: bool = True
) -> tuple[NDArray[np.float64], Sheets | None]:
    """Smallest distance (n,) between balls at each point (n, 3), in the points' unit.

    Parameters
    ----------
    points : (n, 3) float64
        In the canonical frame, whose longest side is 1.
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
    >>> separation(np.eye(3), 0.1)[0]
    array([0.1, 0.1, 0.1])
    """
    if cage_spacing is not None:
        return np.full(len(points), cage_spacing), None
    if len(points) < FEWEST:
        return np.zeros(len(points)), None
    if not coarsen:
        return THINNING * cKDTree(points).query(points, k=[9], workers=-1)[0][:, 0], None
    distance, neighbour = neighbourhoods(points)
    sheets = find_sheets(points, distance, neighbour)
    # A point is as exposed to another sheet, and as little on one itself, as its surroundings are.
    around = neighbour[:, : AROUND + 1]
    reach = np.percentile(sheets.far[around], 25.0, axis=1)
    on_sheet = 1.0 - np.percentile(ramp(sheets.bulk, SHEET)[around], 75.0, axis=1)
    coarsest = np.minimum(COARSEST * distance[:, 1:7].mean(axis=1), WIDEST)
    coarse = np.minimum(COARSENING * reach * on_sheet, coarsest)
    return np.asarray(np.maximum(THINNING * distance[:, 8], coarse)), sheets


def build_balls(
    points: NDArray[np.float64],
    rows: NDArray[np.intp],
    *,
    radius: float = 0.45,
    solid: Solid = "octahedron",
    seed: int = 0,
) -> Balls:
    """Put a ball of `radius` times the distance to the nearest other one at each of `points[rows]`.

    Each solid is turned at random, since equal orientations make the Delaunay tetrahedralisation degenerate.

    Parameters
    ----------
    points : (n, 3) float64, distinct
    rows : (b,) intp
        Which of the points carry a ball.
    radius : float, fraction of the distance to the nearest other ball's centre
        Below 0.5 the balls are disjoint.
    solid : {"octahedron", "icosahedron"}
    seed : int

    Raises
    ------
    ValueError
        Fewer than two balls: one alone has no neighbour to take its radius from.

    Examples
    --------
    >>> build_balls(np.eye(3), np.arange(3)).vertices.shape
    (3, 6, 3)
    """
    if len(rows) < 2:
        raise ValueError(
            f"cage_spacing must leave at least 2 balls, found {len(rows)} for {len(points)} points"
        )
    centres = points[rows]
    nearest = cKDTree(centres).query(centres, k=2, workers=-1)[0][:, 1]
    radii = radius * nearest
    turns = _random_rotations(len(rows), seed)
    vertices = centres[:, None] + radii[:, None, None] * np.einsum("sj,bij->bsi", SOLIDS[solid], turns)
    return Balls(rows, centres, radii, vertices)


def _random_rotations(count: int, seed: int) -> NDArray[np.float64]:
    """(count, 3, 3) rotations, uniform over SO(3): from unit quaternions."""
    w, x, y, z = np.random.default_rng(seed).normal(size=(4, count))
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    turns = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.ascontiguousarray(turns.transpose(2, 0, 1))
