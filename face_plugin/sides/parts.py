"""Connected parts of a surface, and what is known of each: whether it is open, and what tells its side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.faraday.gradient import ROUNDING, FieldAtPoints
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.result import Side
from face_plugin.sides.graph import Edges, connected_parts, couplings, neighbours_around
from face_plugin.sides.vantage import FEWEST, is_open

__all__ = ["borne_out", "open_parts", "parts", "several_parts", "told_by"]

# Spacings from which neighbours are not of one part, times the square of what couples them. Within a plane scan lines
# are of one part, seven times as far apart as the points along them; across a right angle, where the coupling is 0.2 to
# 0.5, only the nearest points are: what lies farther is another sheet.
REACH = 8.0
# Share of the points of a part from which it counts as seen, closed and open: through the gaps of a sheet of points at
# random sensors seem to see a seventh of what lies behind, and the field tells a closed part's side without them.
SEEN_CLOSED, SEEN_OPEN = 0.2, 0.01


def parts(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.intp]:
    """Find the connected part that each point (n,) belongs to; parts are numbered from 0.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64

    Examples
    --------
    >>> from face_plugin.shapes import disjoint_spheres
    >>> balls = disjoint_spheres(1000)
    >>> int(parts(Neighbourhood(balls.points), balls.normals).max()) + 1
    2
    """
    edges = neighbours_around(around, normals)
    length = np.linalg.norm(around.points[edges.first] - around.points[edges.second], axis=1)
    spacing = np.maximum(around.spacing[edges.first], around.spacing[edges.second])
    joined = length < REACH * spacing * couplings(around.points, normals, edges) ** 2
    everyone = np.ones(len(around), dtype=np.bool_)
    return connected_parts(everyone, Edges(edges.first[joined], edges.second[joined]))[0]


def several_parts(around: Neighbourhood, normals: NDArray[np.float64]) -> bool:
    """Whether more than one part is large enough to tell whether it is open.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64
        Of either sign.

    Examples
    --------
    >>> from face_plugin.shapes import disjoint_spheres, sphere
    >>> one, two = sphere(500), disjoint_spheres(1000)
    >>> [several_parts(Neighbourhood(some.points), some.normals) for some in (one, two)]
    [False, True]
    """
    return bool((np.bincount(parts(around, normals)) > FEWEST).sum() > 1)


def open_parts(part: NDArray[np.intp], field: FieldAtPoints) -> NDArray[np.bool_]:
    """Whether the part (n,) of each point encloses nothing: the field is alike on both of its sides.

    Parts of too few points to tell are as the whole cloud is. Those where no field gets lie inside others; they enclose
    something.

    Parameters
    ----------
    part : (n,) intp
        As `parts` has it.
    field : FieldAtPoints
        What the field says of the points.

    Examples
    --------
    >>> part = np.repeat([0, 1, 2], [200, 200, 5])
    >>> difference = np.repeat([1.0, 0.5, 1.0], [200, 200, 5])
    >>> opened = open_parts(part, FieldAtPoints(np.ones(405), np.zeros((405, 3)), difference))
    >>> opened[[0, 200, 400]]
    array([False,  True,  True])
    """
    # In the dark the difference is rounding.
    difference = np.where(field.strength > ROUNDING, field.difference, 1.0)
    count = np.bincount(part)
    opened = np.full(len(count), is_open(difference))
    for large in np.flatnonzero(count > FEWEST):
        opened[large] = is_open(difference[part == large])
    return opened[part]


def told_by(
    part: NDArray[np.intp],
    opened: NDArray[np.bool_],
    normals: NDArray[np.float64],
    field: FieldAtPoints,
    seen: NDArray[np.bool_] | None = None,
) -> NDArray[np.uint8]:
    """Find what told the sides of normals: a `Side` (n,), the same for all points of a part.

    Parameters
    ----------
    part, opened
        As of `parts` and `open_parts`.
    normals : (n, 3) float64
    field : FieldAtPoints
    seen : (n,) bool, optional
        Which points sensors saw.

    Examples
    --------
    >>> up = np.tile([0.0, 0.0, 1.0], (4, 1))
    >>> field = FieldAtPoints(np.ones(4), up, np.ones(4))
    >>> told_by(np.array([0, 1, 2, 2]), np.array([1, 1, 0, 0]) > 0, up, field, np.array([1, 0, 0, 0]) > 0)
    array([2, 0, 1, 1], dtype=uint8)
    """
    count = np.bincount(part)
    closed = np.bincount(part, opened) == 0
    # Of a closed part the field is not believed where sensors that saw others speak against it.
    side = np.where(closed & (_field_says(part, normals, field) >= 0), Side.FIELD, Side.CHOSEN).astype(np.uint8)
    if seen is not None:
        side[np.bincount(part, seen) > np.where(closed, SEEN_CLOSED, SEEN_OPEN) * count] = Side.SENSORS
    return side[part]


def borne_out(
    part: NDArray[np.intp], sides: NDArray[np.uint8], normals: NDArray[np.float64], field: FieldAtPoints
) -> NDArray[np.float64]:
    """Tell how far (n,) the field bears out the side of the part of each point, in [0, 1].

    It is 1 where field or sensors told the side. Where the side was chosen, it is the mean of what the field says for
    it, which is near 0 on an open sheet, and on two layers that lie so close that no field tells them apart.

    Parameters
    ----------
    part, sides
        As of `parts` and `told_by`.
    normals : (n, 3) float64
    field : FieldAtPoints

    Examples
    --------
    >>> up = np.tile([0.0, 0.0, 1.0], (4, 1))
    >>> field = FieldAtPoints(np.ones(4), up * np.array([1, -1, 1, 1])[:, None], np.array([1.0, 0.5, 1.0, 1.0]))
    >>> borne_out(np.array([0, 0, 1, 1]), np.array([0, 0, 1, 1], dtype=np.uint8), up, field)
    array([0.25, 0.25, 1.  , 1.  ])
    """
    says = _field_says(part, normals, field) / np.bincount(part)
    return np.where(sides == Side.CHOSEN, np.clip(says, 0.0, 1.0)[part], 1.0)


def _field_says(part: NDArray[np.intp], normals: NDArray[np.float64], field: FieldAtPoints) -> NDArray[np.float64]:
    """Sum of what the field says for the normals of each part (p,), from -1 to 1 a point."""
    return np.asarray(np.bincount(part, field.difference * np.einsum("nd,nd->n", field.votes, normals)), np.float64)
