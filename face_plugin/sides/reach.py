"""Reach: what free space gets to through gaps wider than the sampling is free space as well, however dark it is there.

In a bottle, a vase or a shelf the field fades, and what is left of it may have come through the wall. The points alone
tell: in their Delaunay tetrahedra, free space spreads from outside through each facet that is wider than the gaps of
the sampling. A point with free space on one side, and none on the other, knows its side.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import better_signs
from face_plugin.sides.graph import connected_parts, couplings, neighbours_around
from face_plugin.sides.patches import SMALLEST, winding_number

__all__ = ["out_of_reach", "reach"]

# Radius of the circle around a facet from which it lets through, in spacings: the least, for even samplings, and so
# much more a unit of the coefficient of variation of the nearest distances, which is 0.05 to 0.1 on even samplings and
# 0.52 at random. There, one facet in ten thousand is wider.
WIDE, WIDER = 1.25, 1.5
# A point is inside out where the winding number of the others is farther than this from the surface's 1/2.
INSIDE_OUT = 0.5
# A patch that is turned must fit in: how far its winding numbers are from 1/2 then, next to how far they were.
FITS = 0.5
# A cavity has a mouth: at this share of the points of a patch E_max is more than so much. In crossing bodies, where a
# part of the one lies inside the other and nothing is reached, it is less; there is no need to look.
MOUTH, LIT = 0.05, 0.05


def out_of_reach(
    around: Neighbourhood, normals: NDArray[np.float64], strength: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Find patches to turn (n,): what lies behind them is reached from outside, and what lies in front is not.

    Looked for only where the winding number says that something is inside out, and light falls on a part of it.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64
        Unit normals.
    strength : (n,) float64
        E_max at the points.

    Examples
    --------
    >>> from face_plugin.shapes import cup
    >>> mug = cup(3000)
    >>> inner = np.einsum("nd,nd->n", mug.points * [1, 1, 0], mug.normals) < -0.1
    >>> wrong = np.where(inner[:, None], -mug.normals, mug.normals)
    >>> turned = out_of_reach(Neighbourhood(mug.points), wrong, inner + 0.0)
    >>> bool((turned == inner).mean() > 0.99)
    True
    """
    found = np.zeros(len(around), dtype=np.bool_)
    edges = neighbours_around(around, normals)
    off = np.abs(winding_number(around, normals) - 0.5)
    patch, count = connected_parts(off > INSIDE_OUT, edges, SMALLEST)
    if count == 0:
        return found
    members, lit = np.bincount(patch[patch >= 0]), np.bincount(patch[(patch >= 0) & (strength > LIT)], minlength=count)
    if not (lit > MOUTH * members).any():
        return found
    sign = better_signs(len(around), edges, couplings(around.points, normals, edges), reach(around, normals))
    # Less than a patch is a point deep in the band in which points scatter.
    patch, count = connected_parts(sign < 0, edges, SMALLEST)
    turned = patch >= 0
    then = np.abs(winding_number(around, np.where(turned[:, None], -normals, normals)) - 0.5)
    before, after = (np.bincount(patch[turned], values[turned], count) for values in (off, then))
    found[turned] = (after < FITS * before)[patch[turned]]
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
    points, nearest = around.points, around.distance[:, 1]
    wide = (WIDE + WIDER * float(nearest.std() / nearest.mean())) * around.spacing
    tetrahedra = Delaunay(points)
    corners = tetrahedra.simplices
    reached = _reached(points, corners, tetrahedra.neighbors, wide)
    centre = points[corners].mean(axis=1)
    # Behind and in front of each point: tetrahedra, and those of them that are reached.
    count, free = np.zeros((2, len(points))), np.zeros((2, len(points)))
    for corner in corners.T:
        front = np.einsum("nd,nd->n", centre - points[corner], normals[corner]) > 0
        for side, there in enumerate((~front, front)):
            count[side] += np.bincount(corner[there], minlength=len(points))
            free[side] += np.bincount(corner[there & reached], minlength=len(points))
    # Beyond the hull there are none.
    share = np.where(count > 0, free / np.maximum(count, 1), 1.0)
    return np.asarray(share[1] - share[0])


def _reached(
    points: NDArray[np.float64], corners: NDArray[np.intp], beside: NDArray[np.intp], wide: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which tetrahedra (t,) free space gets to, through facets wider than the mean of `wide` (n,) at their corners."""
    outside = len(corners)
    one, other = [], []
    for k in range(4):
        facet = np.delete(corners, k, axis=1)
        a, b, c = (points[facet[:, i]] for i in range(3))
        u, v = b - a, c - a
        area = 0.5 * np.linalg.norm(np.cross(u, v), axis=1)
        sides = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1) * np.linalg.norm(u - v, axis=1)
        through = sides > 4.0 * area * wide[facet].mean(axis=1)
        one.append(np.flatnonzero(through))
        other.append(np.where(beside[through, k] < 0, outside, beside[through, k]))
    first, second = np.concatenate(one), np.concatenate(other)
    link = coo_matrix((np.ones(len(first)), (first, second)), shape=(outside + 1, outside + 1))
    label = connected_components(link, directed=False)[1]
    return np.asarray(label[:outside] == label[outside])
