"""What the sensors saw: where they stood, what their lines of sight leave free, and the sides that follow.

A point that a sensor saw faces it: the space between was free. Which points a sensor saw is not always known, but the
points themselves tell: a line of sight is free unless it passes another point, nearer to the sensor, within about the
distance to that one's neighbours. Each point then leans to the sensors that see it, by the cosine of the angle to its
line; points that none sees, and grazing ones, take the side of the sheet that they are part of.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.cloud import Frame
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.graph import couplings, neighbours_around
from face_plugin.sides.patches import Planes, planes_of
from face_plugin.threads import KDTree

__all__ = ["Sensors", "facing", "resettled", "sensors_of", "sides_by_sensors", "sights", "visible"]

# A point blocks what is behind it within this share of its spacing: the points of an even sheet cover it.
COVER = 0.7
# What is less than this many spacings behind is the same surface, seen at a slant; with more, thin walls are seen
# through.
BEHIND = 1.0
# Points of like apparent size that are looked at in the direction of each.
LOOKED_AT = 4
# Octaves of apparent size told apart; larger and smaller ones count as the last.
OCTAVES = 12
# Viewpoints of a trajectory that stand for all: the farthest from one another.
MOST_VIEWPOINTS = 12
# Weight of a line of sight next to the couplings of a point to its neighbours, which are 1 at most each: a few false
# sights, through gaps, must not tear a sheet.
SIGHT = 0.5
# Distance from which a direction is looked along, in diagonals of the cloud.
FAR_AWAY = 1000.0


@dataclass(frozen=True, eq=False)
class Sensors:
    """Where sensors stood, in the unit of the points.

    Raises
    ------
    ValueError
        Wrong shape, nothing finite, or rows that name no viewpoint.

    Examples
    --------
    >>> Sensors(viewpoints=[[0.0, 0.0, 2.0]]).viewpoints.shape
    (1, 3)
    """

    viewpoints: ArrayLike | None = None
    """(k, 3) positions."""
    seen_from: ArrayLike | None = None
    """(n,) row of the viewpoint that saw each point, -1 where that is not known."""
    up: ArrayLike | None = None
    """(3,) direction from which all was seen, from afar; of any length."""

    def __post_init__(self) -> None:
        if self.viewpoints is None and self.up is None:
            raise ValueError("viewpoints or up must be given with seen_from, found neither")
        if self.viewpoints is not None:
            object.__setattr__(self, "viewpoints", _finite("viewpoints", self.viewpoints, 2))
        if self.up is not None:
            up = _finite("up", self.up, 1)
            if not up.any():
                raise ValueError("up must be a direction, found a vector of length 0")
            object.__setattr__(self, "up", up)
        if self.seen_from is not None:
            self._check_rows()

    def _check_rows(self) -> None:
        if self.viewpoints is None:
            raise ValueError("seen_from names rows of viewpoints, and there are none")
        rows = np.asarray(self.seen_from)
        if rows.ndim != 1 or rows.dtype.kind not in "iu":
            raise ValueError(f"seen_from must be an (n,) array of integers, found {rows.shape} of {rows.dtype}")
        count = len(np.asarray(self.viewpoints))
        if len(rows) and (rows.min() < -1 or rows.max() >= count):
            raise ValueError(
                f"seen_from must hold rows of viewpoints, 0 to {count - 1}, or -1; found {rows.min()} to {rows.max()}"
            )
        object.__setattr__(self, "seen_from", rows.astype(np.intp))

    def to_dict(self) -> dict[str, Any]:
        """Return the fields by name, for JSON."""
        fields = {"viewpoints": self.viewpoints, "seen_from": self.seen_from, "up": self.up}
        return {name: None if value is None else np.asarray(value).tolist() for name, value in fields.items()}

    def of(self, kept: NDArray[np.bool_]) -> Sensors:
        """Return those of the points (n,) that are kept."""
        if self.seen_from is None or kept.all():
            return self
        return Sensors(self.viewpoints, self._rows(len(kept))[kept], self.up)

    def _rows(self, count: int) -> NDArray[np.intp]:
        """Rows of the viewpoints, one for each of so many points."""
        rows = np.asarray(self.seen_from)
        if len(rows) != count:
            raise ValueError(f"seen_from must have a row for each of the {count} points, found {len(rows)}")
        return rows

    def in_frame(self, frame: Frame, rows: NDArray[np.intp] | None = None) -> Sensors:
        """Return them in the canonical frame; `rows` (n,) tells which distinct point each input point became."""
        viewpoints, up, seen_from = self.viewpoints, self.up, self.seen_from
        if viewpoints is not None:
            viewpoints = frame.to_unit(np.asarray(viewpoints))
        if up is not None:
            up = frame.rotate(np.asarray(up)[None])[0]
        if seen_from is not None and rows is not None:
            given = self._rows(len(rows))
            distinct = np.full(int(rows.max()) + 1, -1, dtype=np.intp)
            distinct[rows[given >= 0]] = given[given >= 0]
            seen_from = distinct
        return Sensors(viewpoints, seen_from, up)


def sensors_of(
    viewpoints: ArrayLike | None = None, seen_from: ArrayLike | None = None, up: ArrayLike | None = None
) -> Sensors | None:
    """Sensors from loose arguments; None where none is given."""
    if viewpoints is None and seen_from is None and up is None:
        return None
    return Sensors(viewpoints, seen_from, up)


def _finite(name: str, values: ArrayLike, dimensions: int) -> NDArray[np.float64]:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must hold numbers, found {type(values).__name__}") from None
    if name == "viewpoints" and array.shape == (3,):
        array = array[None]
    shape = "(k, 3)" if dimensions == 2 else "(3,)"
    if array.ndim != dimensions or array.shape[-1] != 3 or array.size == 0:
        raise ValueError(f"{name} must have the shape {shape}, found {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, found NaN or infinity")
    return array


def visible(
    points: NDArray[np.float64], spacing: NDArray[np.float64], viewpoint: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which points (n,) no other one hides from a viewpoint.

    Parameters
    ----------
    points : (n, 3) float64
    spacing : (n,) float64
        Mean distance of each point to its neighbours: it covers a disc of that size.
    viewpoint : (3,) float64

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(2000).points
    >>> seen = visible(ball, Neighbourhood(ball).spacing, np.array([0.0, 0.0, 9.0]))
    >>> bool(seen[ball[:, 2] > 0.5].all()), bool(seen[ball[:, 2] < -0.3].any())
    (True, False)
    """
    offset = points - viewpoint
    distance = np.linalg.norm(offset, axis=1)
    seen = distance > 0
    distance = np.maximum(distance, np.finfo(float).tiny)
    direction = offset / distance[:, None]
    size = COVER * spacing / distance
    # A near point is apart from its neighbours by more, as seen from here, than the far ones behind it: each octave of
    # sizes is searched by itself, or those behind would crowd it out.
    octave = np.floor(np.log2(size))
    octave = np.clip(octave, octave.max() - OCTAVES, octave.max())
    for this in np.unique(octave):
        rows = np.flatnonzero(octave == this)
        count = min(LOOKED_AT, len(rows))
        apart, near = KDTree(direction[rows]).query(direction, k=count)
        blocker = rows[near.reshape(len(points), count)]
        gap = distance[:, None] - distance[blocker]
        hidden = (apart.reshape(len(points), count) < size[blocker]) & (
            gap > BEHIND * np.maximum(spacing[:, None], spacing[blocker])
        )
        seen &= ~hidden.any(axis=1)
    return np.asarray(seen)


def sights(around: Neighbourhood, sensors: Sensors) -> NDArray[np.float64]:
    """Sum (n, 3) of the unit directions in which each point is seen; of length 0 where no sensor sees it."""
    points = around.points
    total = np.zeros_like(points)
    views = np.empty((0, 3)) if sensors.viewpoints is None else np.asarray(sensors.viewpoints)
    told = np.zeros(len(points), dtype=np.bool_)
    if sensors.seen_from is not None:
        rows = np.asarray(sensors.seen_from)
        told = rows >= 0
        total[told] = _toward(points[told], views[rows[told]])
    if sensors.up is not None:
        up = np.asarray(sensors.up) / np.linalg.norm(np.asarray(sensors.up))
        views = np.concatenate([views, (points.mean(axis=0) + FAR_AWAY * up)[None]])
    if not told.all():
        for view in _spread(views):
            seen = visible(points, around.spacing, view) & ~told
            total[seen] += _toward(points[seen], view)
    return total


def facing(lines: NDArray[np.float64], seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evidence (n,) of the sides of lines (n, 3): positive where they point to the sensors, in [-1, 1]."""
    return np.asarray(np.clip(np.einsum("nd,nd->n", lines, seen), -1.0, 1.0))


def sides_by_sensors(
    around: Neighbourhood,
    seen: NDArray[np.float64],
    blind: NDArray[np.float64] | None = None,
    planes: Planes | None = None,
) -> NDArray[np.float64]:
    """Find unit normals (n, 3) that face what saw them, along whole sheets; lines are those of planes.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    seen : (n, 3) float64
        As `sights` has it.
    blind : (n, 3) float64, optional
        Normals found without sensors: where no sensor saw, they count, as far as they agree with what was seen.
    planes : Planes, optional
        Those of `around`, where they are known.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(1000)
    >>> around = Neighbourhood(ball.points)
    >>> inward = sides_by_sensors(around, sights(around, Sensors([0.0, 0.0, 0.0])))
    >>> bool(((inward * ball.normals).sum(axis=1) < 0).all())
    True
    """
    lines, edges, coupling = planes or planes_of(around)
    sign = cluster_signs(len(around), edges, coupling, _evidence(lines, seen, blind))
    return np.asarray(lines * sign[:, None])


def _evidence(
    lines: NDArray[np.float64], seen: NDArray[np.float64], blind: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Weigh what tells the sides (n,) of lines: sights, and normals found blind if the sights bear these out.

    A body seen from outside is what its field says it is, also where no sensor looks; a room is its opposite.
    """
    evidence = facing(lines, seen)
    if blind is not None:
        agreed = facing(blind, seen)
        borne_out = max(float(agreed.sum() / max(np.abs(agreed).sum(), np.finfo(float).tiny)), 0.0)
        evidence = evidence + borne_out**2 * np.einsum("nd,nd->n", lines, blind)
    return np.asarray(SIGHT * evidence)


def resettled(
    around: Neighbourhood,
    normals: NDArray[np.float64],
    seen: NDArray[np.float64],
    blind: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Settle the sides of normals (n, 3) of better angles again, by what was seen (n, 3) and along sheets."""
    edges = neighbours_around(around, normals)
    coupling = couplings(around.points, normals, edges)
    # The sides given count as much as a clear sight: lines of better angles are told apart by edges, and joined less.
    sign = cluster_signs(len(around), edges, coupling, _evidence(normals, seen, blind) + SIGHT)
    return np.asarray(normals * sign[:, None])


def _toward(points: NDArray[np.float64], view: NDArray[np.float64]) -> NDArray[np.float64]:
    offset = view - points
    return np.asarray(offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), np.finfo(float).tiny))


def _spread(views: NDArray[np.float64]) -> NDArray[np.float64]:
    """At most so many of the viewpoints: the first, then each time the one farthest from those taken."""
    if len(views) <= MOST_VIEWPOINTS:
        return views
    taken = [int(np.argmax(np.linalg.norm(views - views.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(views - views[taken[0]], axis=1)
    while len(taken) < MOST_VIEWPOINTS:
        taken.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(views - views[taken[-1]], axis=1))
    return views[taken]
