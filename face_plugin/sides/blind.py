"""Sides without sensors: the steps from what the field says to normals on one side each."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from face_plugin.faraday.gradient import FieldAtPoints
from face_plugin.geometry import unit
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.enclosure import DARK, dim
from face_plugin.sides.parts import open_parts, parts
from face_plugin.sides.patches import Planes, turned_patches
from face_plugin.sides.reach import Reach, out_of_reach
from face_plugin.sides.seams import across_seams
from face_plugin.sides.sheets import Sheets
from face_plugin.sides.steps import turn_sides
from face_plugin.sides.vantage import is_open, sides_from_vantage

__all__ = ["sides_as_seen", "sides_by_field"]

# Share of what the field says that must say the same to be one voice: all on a bent sheet, 0.92 on generated streets.
ONE_VOICE = 0.97


def sides_by_field(
    around: Neighbourhood,
    field: FieldAtPoints,
    sheets: Sheets,
    planes: Planes,
    reach: Reach,
    still: NDArray[np.bool_],
    plate: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Find normals (n, 3) of the side that the field, the neighbours and the winding number tell together.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    field : FieldAtPoints
        Its `votes` are rough outward normals, most of them on the right side.
    sheets : Sheets
        Of the points.
    planes : Planes
        Those of `around`.
    reach : Reach
        Of the points.
    still : (n,) bool
        Normals that are known; they take part as they are.
    plate : (n,) bool
        Points of plates, whose side the field alone tells.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> from face_plugin.sides.patches import planes_of
    >>> from face_plugin.sides.sheets import find_sheets
    >>> ball = sphere(1000)
    >>> around, none = Neighbourhood(ball.points), np.zeros(1000, dtype=bool)
    >>> votes = np.where(np.arange(1000)[:, None] % 5, ball.normals, -ball.normals)
    >>> field = FieldAtPoints(np.ones(1000), votes, np.ones(1000))
    >>> side = sides_by_field(around, field, find_sheets(around), planes_of(around), Reach(around), none, none)
    >>> bool(((side * ball.normals).sum(axis=1) > 0).all())
    True
    """
    votes, kept = field.votes, plate | still
    # Stray votes turn round to those around them.
    side = turn_sides(around, votes, field.strength, sheets, kept)
    # Patches that are wrong as a whole are turned as a whole; the steps then tidy up behind them.
    # Of a cloud seen in part, what is sealed off is not judged by how it fits in: most of that is not there.
    lit = field.strength > DARK if still.any() else None

    for along in (planes, None, None):
        facing = unit(side)
        sealed = partial(_sealed, reach, facing, field.strength)
        turned = turned_patches(around, facing, _field_says(field, side), planes=along, lit=lit, sealed=sealed) & ~kept
        if turned.any():
            side = turn_sides(around, np.where(turned[:, None], -side, side), field.strength, sheets, kept)
        elif along is None:
            # Asked again of the same sides, it would say the same.
            break
    if still.any():
        # Of a cloud seen in part, it is not known where outside is.
        return side
    if not is_open(field.difference):
        # In a cavity the field may be a leak, and all that is around agree on the wrong side.
        turned = out_of_reach(reach, unit(side)) & ~kept
        side = np.where(turned[:, None], -side, side)
    # No smooth sheet changes its side.
    turned = across_seams(around, unit(side), _field_says(field, side), planes) & ~kept
    return np.where(turned[:, None], -side, side)


def _sealed(
    reach: Reach, facing: NDArray[np.float64], strength: NDArray[np.float64], asked: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which points (n,) have space behind them that is sealed off, as far as it is asked."""
    maybe = dim(strength)
    return maybe & reach.sealed_behind(facing) if (maybe & asked).any() else np.zeros(len(maybe), dtype=np.bool_)


def sides_as_seen(
    around: Neighbourhood, field: FieldAtPoints, side: NDArray[np.float64], planes: Planes
) -> NDArray[np.float64]:
    """Turn normals (n, 3) of an open scan so that parts that no sheet joins are on one side, as seen from one place.

    Parameters
    ----------
    around, field, planes
        As of `sides_by_field`.
    side : (n, 3) float64
        What that returned.

    Examples
    --------
    >>> from face_plugin.sides.patches import planes_of
    >>> x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    >>> two = np.stack([x.ravel(), y.ravel(), np.where(x.ravel() < 10, 0.0, 5.0) + 0.01 * np.sin(y.ravel())], axis=1)
    >>> mixed = np.outer(np.where(two[:, 2] > 1, -1.0, 1.0), [0.0, 0.0, 1.0])
    >>> around = Neighbourhood(two)
    >>> field = FieldAtPoints(np.ones(400), mixed, np.full(400, 0.1))
    >>> bool(abs(sides_as_seen(around, field, mixed, planes_of(around))[:, 2].mean()) > 0.999)
    True
    """
    side = sides_from_vantage(around, side, planes)
    says = _field_says(field, side)
    # Of the two sides that leaves, a bent sheet knows its outer one, where the field speaks with one voice.
    if says.sum() < -ONE_VOICE * np.abs(says).sum():
        return -side
    # Closed bodies among the parts know theirs.
    closed = ~open_parts(parts(around, unit(side)), field)
    return -side if says[closed].sum() < 0 else side


def _field_says(field: FieldAtPoints, normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weigh what the field says of normals (n, 3): in [-1, 1], positive where they point to the lit side."""
    return np.asarray(field.lean * np.einsum("nd,nd->n", field.votes, normals))
