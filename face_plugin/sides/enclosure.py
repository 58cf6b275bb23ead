"""Which points lie inside the object.

The paper calls a point interior where the field strength falls below a threshold alpha: where it is enclosed by the
alpha-isosurface of E_max (section 3.5). Shielded is not the same as inside, though: the field also fades in a deep
dent that is open to the outside, and at a fixed alpha the surface in there is lost. The oriented points tell the two
apart. Their winding number is 1 inside and 1/2 on the surface, dents included, so ``alpha="auto"`` asks for both: the
point is shielded, and the other points enclose it. In a sharp crease, and between the layers of a misregistered scan,
the number is nearly 1 at the surface as well; but a step along the normal leads out of those, not out of the object.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from face_plugin.geometry import unit
from face_plugin.medians import medians
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.params import ALPHAS
from face_plugin.sides.graph import Edges, connected_parts
from face_plugin.sides.patches import SMALLEST
from face_plugin.sides.seams import both_alone

__all__ = ["DARK", "automatic_alpha", "dim", "enclosed", "threshold"]

# Winding numbers above which a point is enclosed by the others: at the point itself the paper's threshold (the surface
# has 1/2, its concave edges 3/4); a step outward somewhat more than that of the surface; and there, with the points
# left out of the sum back in, still more than nothing.
ENCLOSED = 0.9
STILL_ENCLOSED = 0.6
BY_ALL = 0.35
# Length of the step beyond the band in which the points scatter, in spacings: what lies less deep counts as surface.
STEP = 1.0
# Two layers are apart where there is a gap of this many spacings between heights above the tangent plane: in normally
# distributed noise as large as the spacing gaps are smaller, out to twice the deviation.
APART = 0.25
# Points scatter where their nearest so many lie this many spacings above or below them, at most points around.
NEAREST = 6
SCATTER = 0.3
# Points farther than this many spacings from the normal through a point do not stand above it.
BESIDE = 2.4
# The step goes along the mean normal of so many neighbours, less those that face away by more than this cosine.
AROUND = 6
ACROSS = -0.5
# Width of the kernel of the winding number, in spacings: the wider, the deeper a point must lie to count as enclosed.
ENCLOSED_WIDTH = 0.5
# Points inside are joined to so many of their nearest.
JOINED = 8
# An edge leads along the sheet if it leaves the tangent plane by less than this (sine).
AHEAD = 0.5
# Where a part ends, another sheet passes within this many spacings if it is cut off there: points count as enclosed
# only some way behind it.
CROSSING = 3.0
# Points with less field than this take no part in the next pass where their number exceeds the pass's bound, which
# rises as the numbers get clearer. No dent that is open to the outside is as dark.
DARK = 1e-4
PASSES = (0.6, 0.7, 0.8)
# What is enclosed shows how far the field leaks in: alpha is this percentile of its strength, within the bounds.
LEAK_PERCENTILE = 90.0
ALPHA_BOUNDS = (0.03, 0.3)


def dim(strength: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where the field (n,) is so weak that what is there may be inside, whatever alpha.

    Examples
    --------
    >>> dim(np.array([0.01, 0.1]))
    array([ True, False])
    """
    return strength < ALPHA_BOUNDS[0]


def enclosed(
    around: Neighbourhood,
    normals: NDArray[np.float64],
    strength: NDArray[np.float64],
    near: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Which points (n,) the others enclose: the winding number is near 1 there, and still high a step outward.

    What lies inside has no outward side and would blur the number. So it is computed again and again, each time without
    the points in the dark that were enclosed the time before. The walls of a deep cavity may be among these; a step
    outward from them, by all points together, is outside.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    normals : (n, 3) float64
    strength : (n,) float64
        E_max at the points.
    near : (n,) bool, optional
        Points that lie as close as the cloud's do; by default all. Others stand for many, and their neighbours are no
        part of the same surface.

    Examples
    --------
    >>> from face_plugin.shapes import nested_box
    >>> box = nested_box(2000)
    >>> found = enclosed(Neighbourhood(box.points), box.normals, np.where(box.interior, 0.0, 1.0))
    >>> bool((found == box.interior).mean() > 0.99)
    True
    """
    points, spacing, tree = around.points, around.spacing, around.tree
    width = ENCLOSED_WIDTH * spacing
    smooth = _out_of_creases(around, normals)
    normals = smooth if near is None else np.where(near[:, None], smooth, normals)
    outer = normals
    number = tree.number(outer, width)
    left_out = np.zeros(len(points), dtype=np.bool_)
    for bound in PASSES:
        inner = (strength < DARK) & (number > bound)
        if not np.array_equal(inner, left_out):
            left_out = inner
            outer = np.where(inner[:, None], 0.0, normals)
            number = tree.number(outer, width)
    found = number > ENCLOSED
    rows = np.flatnonzero(found)
    step = STEP * spacing[rows]
    scattered = _scatters(around, normals, rows)
    step[scattered] += _band(around, normals, rows[scattered])
    for dipoles, bound in ((outer, STILL_ENCLOSED), (normals, BY_ALL)):
        if len(rows) == 0:
            return found
        still = tree.number(dipoles, width[rows], points[rows] + step[:, None] * normals[rows]) > bound
        found[rows] = still
        rows, step = rows[still], step[still]
    # What lies inside is a surface of its own. Fewer points are the deepest of a noisy sheet, or of a narrow slot.
    joined = around.neighbour[:, 1 : JOINED + 1]
    edges = Edges(np.repeat(np.arange(len(points)), joined.shape[1]), joined.ravel())
    part, count = connected_parts(found, edges, SMALLEST)
    bounded = ~_goes_on(around, normals, part, count, edges)
    return np.asarray((part >= 0) & np.append(bounded, False)[part])


def _goes_on(
    around: Neighbourhood, normals: NDArray[np.float64], part: NDArray[np.intp], count: int, edges: Edges
) -> NDArray[np.bool_]:
    """Whether parts (count,) of what is enclosed go on outside without passing another sheet, as those of a scroll do.

    Inside and outside meet where sheets cross. Where a sheet leads from one to the other by itself, its points are
    enclosed by degrees, and free space gets to them along it.
    """
    first, second = edges.first, edges.second
    # A few points amid a part that do not count as enclosed are no outside.
    outside = connected_parts(part < 0, edges, SMALLEST)[0] >= 0
    rim = (part[first] >= 0) & outside[second]
    first, second = first[rim], second[rim]
    offset = around.points[second] - around.points[first]
    height = np.abs(np.einsum("nd,nd->n", offset, normals[first]))
    ahead = height < AHEAD * np.linalg.norm(offset, axis=1)
    first, second = first[ahead], second[ahead]
    free = both_alone(around, normals, first, second, CROSSING)
    size = np.bincount(part[first], minlength=count)
    return np.asarray(2 * np.bincount(part[first], free, minlength=count) > size)


def _out_of_creases(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean normals (n, 3) around points: in a sharp crease one normal leads along its other side, and all lead out."""
    near = normals[around.neighbour[:, : AROUND + 1]]
    facing = np.einsum("nkd,nd->nk", near, normals) > ACROSS
    known = np.linalg.norm(normals, axis=1, keepdims=True) > 0
    return np.where(known, unit(np.einsum("nk,nkd->nd", facing, near)), 0.0)


def _scatters(around: Neighbourhood, normals: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether (k,) the points around scatter about their sheet, rather than lie in sheets one behind another."""
    near = around.neighbour[:, 1 : NEAREST + 1]
    offset = around.points[near] - around.points[:, None]
    facing = np.einsum("nkd,nd->nk", normals[near], normals) > 0.5
    height = np.abs(np.einsum("nkd,nd->nk", offset, normals)) * facing
    scatter = height.sum(axis=1) / np.maximum(facing.sum(axis=1), 1) / around.spacing
    # Noise is the sensor's, and all over the cloud: where it is not, scatter is a tangle of parts.
    if np.median(scatter) < SCATTER:
        return np.zeros(len(rows), dtype=np.bool_)
    return np.asarray(medians(scatter, around.neighbour[rows]) > SCATTER)


def _band(around: Neighbourhood, normals: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """How far (k,) the neighbours of points reach up along the normal without a gap, as those of one noisy sheet do.

    Points scatter about a sheet in a band. A deep one of the band is enclosed by the others, and so is a short step
    outward from it; it is part of the surface all the same. A second layer has a gap between.
    """
    neighbour = around.neighbour[rows, 1:]
    offset = around.points[neighbour] - around.points[rows][:, None]
    height = np.einsum("nkd,nd->nk", offset, normals[rows])
    # Only what faces the same way and lies above rather than beside: a second layer that bends comes down at the side.
    same = np.einsum("nkd,nd->nk", normals[neighbour], normals[rows]) > 0
    beside = around.distance[rows, 1:] ** 2 - height**2
    near = beside < (BESIDE * around.spacing[rows, None]) ** 2
    height = np.where(same & near, np.maximum(height, 0.0), 0.0)
    height = np.concatenate([np.zeros((len(rows), 1)), np.sort(height, axis=1)], axis=1)
    gap = np.diff(height, axis=1)
    reached = np.cumsum(gap > APART * around.spacing[rows][:, None], axis=1) == 0
    return np.asarray(np.where(reached, gap, 0.0).sum(axis=1))


def automatic_alpha(strength: NDArray[np.float64]) -> float:
    """Threshold from the data: how strong the field is at the points that the others enclose.

    A leaking cage lets the field in, and what is inside shows it: alpha is the 90th percentile of E_max over the points
    that the others enclose, but at least 0.03, between the paper's two values, and at most 0.3.

    Parameters
    ----------
    strength : (k,) float64
        E_max at the points that the others enclose.

    Examples
    --------
    >>> automatic_alpha(np.array([0.1]))
    0.1
    """
    if len(strength) == 0:
        return ALPHA_BOUNDS[0]
    return float(np.clip(np.percentile(strength, LEAK_PERCENTILE), *ALPHA_BOUNDS))


def threshold(alpha: float | str, strength_of_enclosed: Callable[[], NDArray[np.float64]]) -> float:
    """Alpha as a number: one that is given, one of the paper's by name, or with "auto" that of `automatic_alpha`.

    Examples
    --------
    >>> threshold("sparse", lambda: np.empty(0)), threshold("auto", lambda: np.array([0.1]))
    (0.05, 0.1)
    """
    if alpha == "auto":
        return automatic_alpha(strength_of_enclosed())
    return ALPHAS[alpha] if isinstance(alpha, str) else alpha
