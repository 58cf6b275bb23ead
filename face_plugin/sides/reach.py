"""Reach: what free space gets to through gaps wider than the sampling is free space as well, however dark it is there.

In a bottle, a vase or a shelf the field fades, and what is left of it may have come through the wall. The points alone
tell: in their Delaunay tetrahedra, free space spreads from outside as a ball that is wider than the gaps of the
sampling. A point with free space on one side, and none on the other, knows its side.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from face_plugin.faraday.meshers.delaunay import tetrahedralize
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.alpha_shape import AlphaShapes
from face_plugin.sides.clusters import cluster_signs, where_better
from face_plugin.sides.graph import connected_parts, couplings, neighbours_around
from face_plugin.sides.patches import SMALLEST, winding_number

__all__ = ["out_of_reach", "reach", "reached_places", "sealed_behind"]

# Radius of the ball that free space spreads as, in spacings: the least, for even samplings, and so much more a unit of
# the coefficient of variation of the nearest distances, which is 0.05 to 0.1 on even samplings and 0.52 at random.
# There, the circle around one facet in ten thousand is wider.
WIDE, WIDER = 1.25, 1.5
# Balls that are tried, in that radius: at random the widest gap of a million points is half as wide again as that of
# ten thousand.
WIDENED = (1.0, 1.15, 1.3, 1.5)
# Space is wide if a ball so much larger fits in: in a bore that the ball does not get into, gaps of its wall make room
# for one as large here and there.
ROOMY = 1.15
# Points are moved by at most so many spacings before they are meshed: rows are the worst case of meshers.
OUT_OF_ROWS = 1e-3
# A point is inside out where the winding number of the others is farther than this from the surface's 1/2.
INSIDE_OUT = 0.5
# Weight of what is reached next to the couplings of a point to its neighbours, which are 1 at most each, when patches
# are looked for: across a thin wall these are as many as along it. A patch is turned if its evidence, without that
# weight, is more than the couplings around it: in cavities these are 0.75 of it at most. Between the layers of
# misregistered scans, where as much is reached as is not, they are twice as much and more.
CERTAIN = 4.0
# A patch that is turned must fit in: how far its winding numbers are from 1/2 then, next to how far they were. In
# cavities it is 0.05 to 0.25; in the layers of misregistered scans, where all of them are off, 0.4 and more.
FITS = 1 / 3


def out_of_reach(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find patches to turn (n,): what lies behind them is reached from outside, and what lies in front is not.

    Looked for only where the winding number says that something is inside out, and is more than a crease.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64
        Unit normals.

    Examples
    --------
    >>> from face_plugin.shapes import cup
    >>> mug = cup(3000)
    >>> inner = np.einsum("nd,nd->n", mug.points * [1, 1, 0], mug.normals) < -0.1
    >>> wrong = np.where(inner[:, None], -mug.normals, mug.normals)
    >>> turned = out_of_reach(Neighbourhood(mug.points), wrong)
    >>> bool((turned == inner).mean() > 0.99)
    True
    """
    found = np.zeros(len(around), dtype=np.bool_)
    edges = neighbours_around(around, normals)
    off = np.abs(winding_number(around, normals) - 0.5)
    # In a sharp crease the number is off as well, along a line of points; a line across the cloud has the root of n.
    if connected_parts(off > INSIDE_OUT, edges, max(SMALLEST, math.isqrt(len(around))))[1] == 0:
        return found
    reached = reach(around, normals)
    coupling = couplings(around.points, normals, edges)
    sign = where_better(cluster_signs(len(around), edges, coupling, CERTAIN * reached), edges, coupling, reached)
    # Less than a patch is a point deep in the band in which points scatter.
    patch, count = connected_parts(sign < 0, edges, SMALLEST)
    turned = patch >= 0
    then = np.abs(winding_number(around, np.where(turned[:, None], -normals, normals)) - 0.5)
    inside_out, before, after = (
        np.bincount(patch[turned], values[turned], count) for values in (off > INSIDE_OUT, off, then)
    )
    found[turned] = ((inside_out >= SMALLEST) & (after < FITS * before))[patch[turned]]
    return found


def reach(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tell how far free space gets to each point on the side that its normal points to, and to the other not.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64

    Returns
    -------
    (n,) float64
        Share of the tetrahedra in front of a point that are reached, less that of those behind it: 1 where the normal
        is right for certain, -1 where it is wrong, 0 where both sides are alike.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> around = Neighbourhood(ball.points)
    >>> bool(reach(around, ball.normals).mean() > 0.9), bool(reach(around, -ball.normals).mean() < -0.9)
    (True, True)
    """
    return _reached(around, normals, tetrahedralize(_out_of_rows(around)))[1]


def sealed_behind(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which points (n,) have space behind them that is wide, and that free space does not get to from outside.

    Matter is, and so is the inside of a body within another. What faces it is the wall of a cavity.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> around = Neighbourhood(ball.points)
    >>> bool(sealed_behind(around, ball.normals).mean() > 0.9), bool(sealed_behind(around, -ball.normals).any())
    (True, False)
    """
    corners = tetrahedralize(_out_of_rows(around))
    reached, _, roomy = _reached(around, normals, corners)
    behind = ~_in_front(around.points, normals, corners)
    count = np.bincount(corners[behind], minlength=len(around))
    sealed = np.bincount(corners[behind & (roomy & ~reached)[:, None]], minlength=len(around))
    return np.asarray(2 * sealed > count)


def reached_places(
    around: Neighbourhood, normals: NDArray[np.float64], places: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which places (k, 3) free space gets to from outside, past points with these normals (n, 3).

    Examples
    --------
    >>> from face_plugin.shapes import cup
    >>> mug = cup(3000)
    >>> places = np.array([[0.0, 0.0, 0.7], [0.0, 0.0, 0.95], [0.55, 0.0, 0.3]])
    >>> reached_places(Neighbourhood(mug.points), mug.normals, places).tolist()
    [True, True, False]
    """
    mesh = Delaunay(_out_of_rows(around))
    reached, _, _ = _reached(around, normals, mesh.simplices)
    at = mesh.find_simplex(places)
    return np.asarray((at < 0) | reached[at])


def _reached(
    around: Neighbourhood, normals: NDArray[np.float64], corners: NDArray[np.int32]
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.bool_]]:
    """Tetrahedra (t,) that are reached, what `reach` returns, and tetrahedra that a larger one fits into.

    A single gap of the sampling lets a ball in, and then all is reached; a ball that is too wide gets into no cavity.
    That ball is taken that leaves most points with free space on one side alone.
    """
    nearest = around.distance[:, 1]
    ball = (WIDE + WIDER * float(nearest.std() / nearest.mean())) * around.spacing
    shapes, in_front = AlphaShapes(around.points, corners), _in_front(around.points, normals, corners)
    tried = []
    for widening in WIDENED:
        reached = shapes.outside(widening * ball)
        tried.append(
            (reached, _evidence(len(around), corners, in_front, reached), shapes.roomy(ROOMY * widening * ball))
        )
    return max(tried, key=lambda found: float(np.abs(found[1]).mean()))


def _in_front(
    points: NDArray[np.float64], normals: NDArray[np.float64], corners: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Whether tetrahedra lie in front of each of their corners (t, 4)."""
    centre = points[corners].mean(axis=1)
    sides = [np.einsum("nd,nd->n", centre - points[corner], normals[corner]) > 0 for corner in corners.T]
    return np.stack(sides, axis=1)


def _evidence(
    size: int, corners: NDArray[np.int32], in_front: NDArray[np.bool_], reached: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Share (n,) of the tetrahedra in front of each point that are reached, less that of those behind it."""
    share = []
    for there in (in_front, ~in_front):
        count = np.bincount(corners[there], minlength=size)
        free = np.bincount(corners[there & reached[:, None]], minlength=size)
        # Beyond the hull there are none.
        share.append(np.where(count > 0, free / np.maximum(count, 1), 1.0))
    return np.asarray(share[0] - share[1])


def _out_of_rows(around: Neighbourhood) -> NDArray[np.float64]:
    moved = np.random.default_rng(0).uniform(-OUT_OF_ROWS, OUT_OF_ROWS, around.points.shape)
    return np.asarray(around.points + moved * around.spacing[:, None])
