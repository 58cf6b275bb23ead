"""Planes that many neighbours share, where a plane through the nearest of them lies on none.

At the foot of a wall, the nearest points lie on the ground and on the wall, and a plane through all of them is neither.
With rings of a scanner, whose points are far denser along than across, that holds for a strip many spacings wide. But
the planes of others near by are right, and one of them passes through the point: the one that most of the neighbours
lie on, and few beside (consensus, Fischler and Bolles 1981). So that it reaches the middle of the strip it is handed on
from point to point, as patches are matched (Barnes et al. 2009).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.planes import covariances
from face_plugin.threads import in_threads

__all__ = ["consensus_lines"]

# A plane passes through what lies within so many standard deviations of it.
DEVIATIONS = 3.0
# Standard deviation of the points: that of the plane of each point's neighbours which so many others come below. Points
# in a row, and a few planes by accident, come lower than the rest.
LOWEST = 5
# It is at least this share of the spacing: rounding.
EXACT = 1e-6
# Times that planes are handed on: as many neighbourhoods the strip is wide.
ROUNDS = 4
# A plane is shared if so many neighbours lie on it, besides twice those that lie beside it, within BESIDE times the
# distance: about a rough surface, no plane has more within a distance than beside it.
SHARED = 16
BESIDE = 4.0
# What lies on it spreads to every side by a standard deviation of so many times that distance: else the line is not
# known. A single row of a scan lies on many planes.
SPREAD = 5.0
# What is seen at less than this sine of the angle to its plane is as good as in it.
GRAZING = 0.1
# Where it is not known from where points were seen, they must be of more rows than this, of which one is bent.
ROW = 1.2


def consensus_lines(
    around: Neighbourhood, lines: NDArray[np.float64], count: int, seen: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Find the lines of shared planes, where those through the nearest points fit these less than others do.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    lines : (n, 3) float64
        Unit normals, of either sign, of planes through the nearest points.
    count : int
        How many these are, without the point itself.
    seen : (n, 3) float64, optional
        Directions in which each point was seen; of any length, 0 where it is not known. No surface contains them, but a
        plane through a single row of a scan does, also where that turns from the ground up a wall.

    Returns
    -------
    (n, 3) float64
        `lines`, and where another plane is shared the unit normal of that.

    Examples
    --------
    >>> from face_plugin.planes import plane_fit
    >>> x, y = (of.ravel() for of in np.meshgrid(np.arange(0.5, 12.0), np.arange(12.0)))
    >>> corner = np.concatenate([np.stack([x, y, 0.0 * x], axis=1), np.stack([0.0 * x, y, x], axis=1)])
    >>> near = Neighbourhood(corner)
    >>> lines = plane_fit(corner, near.distance, near.neighbour, 30, 1.0)
    >>> shared = consensus_lines(near, lines, 30)
    >>> right = [float((np.abs(of).max(axis=1) > 0.999).mean()) for of in (lines, shared)]
    >>> right[0] < 0.8, right[1]
    (True, 1.0)
    """
    points, near = around.points, around.neighbour
    centre = points[near[:, : count + 1]].mean(axis=1)
    off = _off(points, near[:, : count + 1], lines, centre)
    deviation = np.sqrt(np.einsum("nk,nk->n", off, off) / off.shape[1])
    lowest = min(LOWEST, near.shape[1] - 1)
    width = DEVIATIONS * np.partition(deviation[near], lowest, axis=1)[:, lowest]
    width = np.maximum(width, EXACT * around.spacing)
    rows = np.flatnonzero(deviation > width)
    if len(rows) == 0:
        return lines
    near, width = np.ascontiguousarray(near[rows]), width[rows]
    found, centre = _handed_on(points, rows, near, width, lines, centre, seen)

    off = np.abs(_off(points, near, found[rows], centre[rows])) / width[:, None]
    on, beside = off < 1.0, (off >= 1.0) & (off < BESIDE)
    shared = np.flatnonzero((on.sum(axis=1) > SHARED + 2 * beside.sum(axis=1)) & _faces(found, seen)[rows])
    if seen is None:
        shared = shared[_rows(around, near[shared], around.distance[rows[shared]], on[shared]) > ROW]
    spread = np.linalg.eigvalsh(covariances(points, near[shared], on[shared].astype(np.float64)))[:, 1]
    shared = shared[spread > (SPREAD * width[shared]) ** 2]
    out: NDArray[np.float64] = lines.copy()
    out[rows[shared]] = found[rows[shared]]
    return out


def _handed_on(
    points: NDArray[np.float64],
    rows: NDArray[np.intp],
    near: NDArray[np.intp],
    width: NDArray[np.float64],
    lines: NDArray[np.float64],
    centre: NDArray[np.float64],
    seen: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lines and centres (n, 3) of planes, of which some `rows` (m,) took over the best of their neighbours (m, k)."""
    lines, centre = lines.copy(), centre.copy()
    score = _count(_off(points, near, lines[rows], centre[rows]), width)
    fresh = _faces(lines, seen)
    for _ in range(ROUNDS):
        which = _best(points, rows, near, width, lines, centre, fresh, score)
        moved = np.flatnonzero(which >= 0)
        if len(moved) == 0:
            break
        at, line, middle = near[moved], lines[which[moved]], centre[which[moved]]
        # The points that lie on it tell a plane better than those near another point do.
        weight = _on(_off(points, at, line, middle), width[moved]) ** 2
        fitted = np.ascontiguousarray(np.linalg.eigh(covariances(points, at, weight))[1][:, :, 0])
        mean = np.einsum("nk,nkd->nd", weight, points[at]) / weight.sum(axis=1, keepdims=True)
        then = _count(_off(points, at, fitted, mean), width[moved])
        better = then > score[moved]
        score[moved] = np.maximum(then, score[moved])
        lines[rows[moved]] = np.where(better[:, None], fitted, line)
        centre[rows[moved]] = np.where(better[:, None], mean, middle)
        # What was looked at once says the same again.
        fresh[:] = False
        fresh[rows[moved]] = True
        fresh &= _faces(lines, seen)
    return lines, centre


def _faces(lines: NDArray[np.float64], seen: NDArray[np.float64] | None) -> NDArray[np.bool_]:
    """Which planes (n,) do not contain the direction in which their point is seen."""
    if seen is None:
        return np.ones(len(lines), dtype=np.bool_)
    return np.asarray(np.abs(np.einsum("nd,nd->n", lines, seen)) >= GRAZING * np.linalg.norm(seen, axis=1))


def _rows(
    around: Neighbourhood, near: NDArray[np.intp], distance: NDArray[np.float64], on: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Of how many rows (m,), straight and long, the neighbours (m, k) are that lie `on` planes (m, k)."""
    step = np.median(around.distance[near, 1], axis=1)
    return np.asarray(on.sum(axis=1) * step / (2.0 * np.where(on, distance, 0.0).max(axis=1)))


def _off(
    points: NDArray[np.float64], near: NDArray[np.intp], lines: NDArray[np.float64], centre: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances (m, k) of neighbours (m, k) from planes with lines (m, 3) and centres (m, 3)."""
    level = np.einsum("nd,nd->n", lines, centre)
    return np.asarray(np.matmul(points[near], lines[:, :, None])[:, :, 0] - level[:, None])


def _on(off: NDArray[np.float64], width: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much (m, k) lies on planes: 1 at distance 0, nothing from the width (m,) on."""
    return np.maximum(1.0 - (off / width[:, None]) ** 2, 0.0)


def _count(off: NDArray[np.float64], width: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many neighbours (m,) lie on planes."""
    return np.asarray(_on(off, width).sum(axis=1))


def _best(
    points: NDArray[np.float64],
    rows: NDArray[np.intp],
    near: NDArray[np.intp],
    width: NDArray[np.float64],
    lines: NDArray[np.float64],
    centre: NDArray[np.float64],
    fresh: NDArray[np.bool_],
    score: NDArray[np.float64],
) -> NDArray[np.intp]:
    """Find whose plane (m,), of the `fresh` ones near by, more neighbours lie on than the `score` (m,), which it sets.

    -1 where no plane that passes through the point has more.
    """
    which = np.full(len(rows), -1)
    level = np.einsum("nd,nd->n", lines, centre)

    def run(some: slice) -> None:
        _best_planes(
            some.start, some.stop, points, rows, near, width, lines, level, fresh, score, which,
            np.empty((3, near.shape[1])),
        )  # fmt: skip

    in_threads(run, len(rows), 64)
    return which


@compiled(nogil=True, fastmath=True, error_model="numpy")
def _best_planes(  # type: ignore[no-untyped-def]
    first, last, points, rows, near, width, lines, level, fresh, score, which, local
):
    for row in range(first, last):
        i, scale = rows[row], 1.0 / (width[row] * width[row])
        for k in range(near.shape[1]):
            for d in range(3):
                local[d, k] = points[near[row, k], d]
        for k in range(1, near.shape[1]):
            j = near[row, k]
            if not fresh[j]:
                continue
            x, y, z, at = lines[j, 0], lines[j, 1], lines[j, 2], level[j]
            off = points[i, 0] * x + points[i, 1] * y + points[i, 2] * z - at
            if off * off * scale >= 1.0:
                continue
            count = 0.0
            for other in range(near.shape[1]):
                off = local[0, other] * x + local[1, other] * y + local[2, other] * z - at
                count += max(1.0 - off * off * scale, 0.0)
            if count > score[row]:
                score[row], which[row] = count, j
