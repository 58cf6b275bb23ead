"""What points in the plane say of the curve that they lie on, before any orientation, and the sides that follow.

The steps are those of surfaces, and simpler: along a curve a point has a neighbour before it and one behind it, so
sides spread along the curve as far as it goes, past corners and crossings; the field then decides on each curve as a
whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.graph import Edges, couplings
from face_plugin.threads import KDTree

__all__ = ["CurveLines", "curve_separation", "lines_of_curves", "sides_of_curves", "tangents"]

# Neighbours that a line is fitted to: of these sizes the one at which points look most like a line.
SIZES = (6, 12, 24, 48, 96)
# Width of the Gaussian weight, as a fraction of the distance to the farthest of them.
WEIGHT_WIDTH = 0.8
# Neighbours whose median scatter is that of the points.
AROUND = 24
# Smallest distance between discs: as a fraction of the distance to the 4th neighbour, which is two points farther on an
# even curve; and where points scatter, in deviations: the field of single points in a band is no guide.
DUPLICATE = 0.25
BAND = 4.0
# But no more than this fraction of the cloud's diagonal: a handful of points shows no band.
BROADEST = 0.05
# Points scatter where the deviation is more than this many spacings, there and at most points: noise is the sensor's,
# and all over the cloud.
SCATTER = 0.1
# Neighbours that an edge leads to, ahead and back each; and the least cosine between the edge and the curve.
AHEAD = 2
COSINE = 0.45
# Squared error of a line, in squared radians, at which its couplings count half.
DOUBT = 0.1
# Weight of the field next to the couplings of a point to its neighbours, which are 1 at most each.
FIELD = 0.05
# A curve is dark where the field says less than this of it, per point.
DARK = 1e-6
# Rows at a time: a table of 97 neighbours takes memory.
BLOCK = 16384


@dataclass(frozen=True)
class CurveLines:
    """Lines through each point's neighbours, of the size at which these look most like a line."""

    normals: NDArray[np.float64]
    """(n, 2) unit normals, of either sign."""
    scatter: NDArray[np.float64]
    """(n,) how far points around lie off them: their deviation, in the points' unit."""


def tangents(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn normals (n, 2) to the left by a right angle.

    Examples
    --------
    >>> tangents(np.array([[0.0, 1.0]]))
    array([[-1.,  0.]])
    """
    return np.stack([-normals[:, 1], normals[:, 0]], axis=1)


def lines_of_curves(around: Neighbourhood) -> CurveLines:
    """Fit a line to the neighbours of each point.

    Which of the sizes is taken: the one with the least extent across, relative to that along. In noise that is a large
    one, in a narrow slot a small one.

    Examples
    --------
    >>> from face_plugin.shapes.curves import circle
    >>> ring = circle(100)
    >>> lines = lines_of_curves(Neighbourhood(ring.points))
    >>> bool((np.abs((lines.normals * ring.normals).sum(axis=1)) > 0.99).all())
    True
    """
    count = len(around)
    normals, scatter = np.empty((count, 2)), np.empty(count)
    for start in range(0, count, BLOCK):
        rows = slice(start, start + BLOCK)
        normals[rows], scatter[rows] = _flattest(around.points, around.neighbour[rows])
    near = around.neighbour[:, : AROUND + 1]
    return CurveLines(normals, np.median(scatter[near], axis=1))


def _flattest(
    points: NDArray[np.float64], neighbour: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the normal (k, 2) of the line that looks most like one, and the deviation (k,) of points about it."""
    offset = points[neighbour] - points[neighbour[:, :1]]
    squared = np.einsum("nkd,nkd->nk", offset, offset)
    normals, scatter = np.zeros((len(neighbour), 2)), np.zeros(len(neighbour))
    best = np.full(len(neighbour), np.inf)
    last = neighbour.shape[1] - 1
    for size in [size for size in SIZES if size <= last] or [last]:
        near, far = offset[:, : size + 1], squared[:, size : size + 1]
        weight = np.exp(-squared[:, : size + 1] / (WEIGHT_WIDTH**2 * far))
        weight /= weight.sum(axis=1, keepdims=True)
        centred = near - np.einsum("nk,nkd->nd", weight, near)[:, None]
        xx, yy, xy = (np.einsum("nk,nk,nk->n", weight, centred[..., i], centred[..., j]) for i, j in _PAIRS)
        half, mean = np.hypot(0.5 * (xx - yy), xy), 0.5 * (xx + yy)
        # Of the direction across: half the angle of the long axis, turned by a right one.
        angle = 0.5 * np.arctan2(xy, 0.5 * (xx - yy)) + 0.5 * np.pi
        # Two unknowns are fitted to as many points as the weights amount to.
        points_of = 1.0 / np.einsum("nk,nk->n", weight, weight)
        low = np.maximum(mean - half, 0.0) * points_of / np.maximum(points_of - 2.0, 0.5)
        ratio = low / (mean + half)
        better = ratio < best
        best = np.where(better, ratio, best)
        # At the smallest size bending and noise look alike.
        scatter = np.where(better, np.sqrt(low) if size > SIZES[0] else 0.0, scatter)
        normals = np.where(better[:, None], np.stack([np.cos(angle), np.sin(angle)], axis=1), normals)
    return normals, scatter


_PAIRS = ((0, 0), (1, 1), (0, 1))


def curve_separation(around: Neighbourhood, cage_spacing: float | None, *, coarsen: bool = True) -> NDArray[np.float64]:
    """Smallest distance (n,) between discs at each point; as `face_plugin.sides.sheets.cage_separation` in space.

    Parameters
    ----------
    around : Neighbourhood
        Of points in the plane, in the canonical frame, whose diagonal is 1.
    cage_spacing : float or None
        The same for all, in the points' unit. None = near-duplicates go, and where points scatter about their curve
        discs are as far apart as the band of points is wide; 0 for fewer points than 9.
    coarsen : bool
        Whether None may do the second.

    Examples
    --------
    >>> from face_plugin.shapes.curves import circle
    >>> around = Neighbourhood(circle(100).points)
    >>> bool((curve_separation(around, None) < 0.06).all()), float(curve_separation(around, 0.1)[0])
    (True, 0.1)
    """
    if cage_spacing is not None:
        return np.full(len(around), cage_spacing)
    if len(around) < 9:
        return np.zeros(len(around))
    separation = DUPLICATE * around.distance[:, 4]
    if not coarsen:
        return separation
    scatter = lines_of_curves(around).scatter
    scatters = scatter > SCATTER * around.spacing
    band = np.where(scatters & (scatters.mean() > 0.5), np.minimum(BAND * scatter, BROADEST), 0.0)
    return np.maximum(separation, band)


def sides_of_curves(
    points: NDArray[np.float64],
    lines: NDArray[np.float64],
    error: NDArray[np.float64],
    votes: NDArray[np.float64],
    lean: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Sides (n,) of lines: 1 where one points to free space already, -1 where it is to be turned.

    Parameters
    ----------
    points : (n, 2) float64
        On their curves: noise is taken out.
    lines : (n, 2) float64
        Unit normals of either sign.
    error : (n,) float64
        Expected squared error of each, in squared radians; infinite where it is not known.
    votes, lean : (n, 2) float64, (n,) float64
        What the field says of the points, and how clearly.

    Examples
    --------
    >>> from face_plugin.shapes.curves import circle
    >>> ring = circle(100)
    >>> mixed = ring.normals * np.where(np.arange(100) % 2, 1.0, -1.0)[:, None]
    >>> lit = np.arange(100) < 20
    >>> side = sides_of_curves(ring.points, mixed, np.zeros(100), ring.normals, lit.astype(float))
    >>> bool(((mixed * side[:, None] * ring.normals).sum(axis=1) > 0).all())
    True
    """
    count = len(points)
    edges = _along(points, lines)
    trust = DOUBT / (DOUBT + np.where(np.isfinite(error), error, DOUBT))
    coupling = couplings(points, lines, edges) * trust[edges.first] * trust[edges.second]
    evidence = FIELD * lean * np.einsum("nd,nd->n", votes, lines)
    sign = cluster_signs(count, edges, coupling, evidence)
    # A curve in the dark of another one: the field says nothing, and what it encloses is its inside.
    link = coo_matrix((np.ones(len(edges.first)), (edges.first, edges.second)), shape=(count, count))
    curve = connected_components(link, directed=False)[1]
    members = np.bincount(curve)
    middle = np.stack([np.bincount(curve, column) / members for column in points.T], axis=1)
    area = np.bincount(curve, sign * np.einsum("nd,nd->n", lines, points - middle[curve]))
    dark = np.bincount(curve, np.abs(evidence)) < DARK * members
    return np.asarray(np.where((dark & (area < 0))[curve], -sign, sign))


def _along(points: NDArray[np.float64], lines: NDArray[np.float64]) -> Edges:
    """Join each point to its nearest neighbours ahead and back along its line."""
    count = len(points)
    tree, size = KDTree(points), min(SIZES[-1] + 1, count)
    pairs = []
    for start in range(0, count, BLOCK):
        rows = np.arange(start, min(start + BLOCK, count))
        neighbour = tree.query(points[rows], k=size)[1]
        offset = points[neighbour] - points[rows][:, None]
        along = np.einsum("nkd,nd->nk", offset, tangents(lines[rows]))
        distance = np.linalg.norm(offset, axis=2)
        cosine = along / np.where(distance > 0, distance, 1.0)
        # Straight on first, at a crossing: a detour counts as longer.
        length = distance / np.maximum(np.abs(cosine), COSINE)
        for ahead in (cosine > COSINE, cosine < -COSINE):
            place = np.argsort(np.where(ahead, length, np.inf), axis=1, kind="stable")[:, :AHEAD]
            found = np.take_along_axis(ahead, place, axis=1)
            first, which = np.nonzero(found)
            pairs.append(np.stack([rows[first], neighbour[first, place[first, which]]], axis=1))
    # Each pair once, in an order that the points alone decide.
    joined = np.sort(np.concatenate(pairs), axis=1)
    pair = np.unique(joined[:, 0] * count + joined[:, 1])
    return Edges(pair // count, pair % count)
