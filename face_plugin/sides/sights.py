"""What sensors saw: the points that their lines of sight reach.

Which points a sensor saw is not always known, but the points themselves tell: a line of sight is free unless it passes
another point, nearer to the sensor, within about the distance to that one's neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.sensors import MOST_VIEWPOINTS, Sensors
from face_plugin.threads import KDTree

__all__ = ["lit", "sights", "visible"]

# A point blocks what is behind it within this share of its spacing: the points of an even sheet cover it.
COVER = 0.7
# What is less than this many spacings behind is the same surface, seen at a slant; with more, thin walls are seen
# through.
BEHIND = 1.0
# A point that lies this near to another's tangent plane, in spacings, is of its own sheet and does not hide it: sheets
# seen at a grazing angle would hide themselves.
IN_PLANE = 0.35
# Points of like apparent size that are looked at in the direction of each.
LOOKED_AT = 4
# Octaves of apparent size told apart; larger and smaller ones count as the last.
OCTAVES = 12
# Distance from which a direction is looked along, in diagonals of the cloud.
FAR_AWAY = 1000.0


def visible(
    points: NDArray[np.float64],
    spacing: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    lines: NDArray[np.float64],
    asked: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Which points (n,) no other one hides from a viewpoint.

    Parameters
    ----------
    points : (n, 3) float64
    spacing : (n,) float64
        Mean distance of each point to its neighbours: it covers a disc of that size.
    viewpoint : (3,) float64
    lines : (n, 3) float64
        Unit normals of either sign, roughly.
    asked : (n,) bool, optional
        Points that it is asked of; none of the others is found visible.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(2000).points
    >>> seen = visible(ball, Neighbourhood(ball).spacing, np.array([0.0, 0.0, 9.0]), ball)
    >>> bool(seen[ball[:, 2] > 0.3].all()), bool(seen[ball[:, 2] < -0.3].any())
    (True, False)
    """
    seen = (points != viewpoint).any(axis=1)
    if asked is not None:
        seen &= asked
    for at, blocker, gap in _in_the_way(points, seen, points, spacing, viewpoint):
        hidden = gap > BEHIND * np.maximum(spacing[at, None], spacing[blocker])
        some = np.flatnonzero(hidden.any(axis=1))
        at, blocker = at[some], blocker[some]
        off = np.abs(np.einsum("nkd,nd->nk", points[blocker] - points[at, None], lines[at]))
        over = off > IN_PLANE * np.maximum(spacing[at, None], spacing[blocker])
        seen[at] = ~(hidden[some] & over).any(axis=1)
    return np.asarray(seen)


def lit(around: Neighbourhood, sensors: Sensors | None, places: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which places (k, 3) a sensor sees past the points.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = Neighbourhood(sphere(2000).points)
    >>> lit(ball, Sensors([0.0, 0.0, 9.0]), np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -2.0]])).tolist()
    [True, False]
    """
    seen = np.zeros(len(places), dtype=np.bool_)
    if sensors is None:
        return seen
    for view in _spread(_views(around.points, sensors)):
        free = np.ones(len(places), dtype=np.bool_)
        for at, blocker, gap in _in_the_way(places, free, around.points, around.spacing, view):
            free[at] = ~(gap > BEHIND * around.spacing[blocker]).any(axis=1)
        seen |= free
    return seen


def _in_the_way(
    places: NDArray[np.float64],
    free: NDArray[np.bool_],
    points: NDArray[np.float64],
    spacing: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]]:
    """Yield places (j,) that something may hide, points (j, c) in their direction, and how much nearer these are.

    Nearer to the viewpoint, that is; -inf where they do not cover the place. Only places (k, 3) that are still `free`
    (k,) by then are looked at.
    """

    def looked_at(these: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        offset = these - viewpoint
        distance = np.maximum(np.linalg.norm(offset, axis=1), np.finfo(float).tiny)
        return distance, offset / distance[:, None]

    distance, direction = looked_at(points)
    away, ahead = looked_at(places)
    size = COVER * spacing / distance
    # A near point is apart from its neighbours by more, as seen from here, than the far ones behind it: each octave of
    # sizes is searched by itself, or those behind would crowd it out.
    octave = np.floor(np.log2(size))
    octave = np.clip(octave, octave.max() - OCTAVES, octave.max())
    for this in np.unique(octave):
        rows, at = np.flatnonzero(octave == this), np.flatnonzero(free)
        count = min(LOOKED_AT, len(rows))
        # What lies beyond the largest of them covers nothing.
        apart, near = KDTree(direction[rows]).query(ahead[at], k=count, bound=float(size[rows].max()))
        apart, near = apart.reshape(len(at), count), near.reshape(len(at), count)
        some = np.isfinite(apart).any(axis=1)
        at, apart, blocker = at[some], apart[some], rows[np.minimum(near[some], len(rows) - 1)]
        yield at, blocker, np.where(apart < size[blocker], away[at, None] - distance[blocker], -np.inf)


def sights(
    around: Neighbourhood, sensors: Sensors, lines: NDArray[np.float64], asked: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Sum (n, 3) of the directions in which each point is seen; of length 0 where no sensor sees it.

    The direction to the nearest viewpoint that sees a point is of length 1, and those to others are shorter by the
    squares of the distances: a sensor puts points on a surface by ``cos(angle) / distance^2``, and a thin wall that is
    seen from both sides was scanned from where it has most points.

    `lines` (n, 3) are unit normals of either sign, roughly, such as those of planes. Points that are not `asked` (n,)
    are left out; by default none is.
    """
    points = around.points
    total, nearest = np.zeros_like(points), np.full(len(points), np.inf)
    views = _views(points, sensors)
    told = np.zeros(len(points), dtype=np.bool_)
    if sensors.seen_from is not None:
        rows = np.asarray(sensors.seen_from)
        told = rows >= 0
        total[told] = _toward(points[told], views[rows[told]])
    if told.all():
        return total
    near = len(views) - (sensors.up is not None)
    for view in _spread(views[:near]):
        seen = visible(points, around.spacing, view, lines, asked) & ~told
        squared = np.sum((points[seen] - view) ** 2, axis=1)
        total[seen] += _toward(points[seen], view) / squared[:, None]
        nearest[seen] = np.minimum(nearest[seen], squared)
    total[~told] *= np.where(np.isfinite(nearest), nearest, 1.0)[~told, None]
    for view in views[near:]:
        seen = visible(points, around.spacing, view, lines, asked) & ~told
        total[seen] += _toward(points[seen], view)
    return total


def _views(points: NDArray[np.float64], sensors: Sensors) -> NDArray[np.float64]:
    """Viewpoints (k, 3); the last is far away where all was seen from one direction."""
    views = np.empty((0, 3)) if sensors.viewpoints is None else np.asarray(sensors.viewpoints)
    if sensors.up is None:
        return views
    up = np.asarray(sensors.up) / np.linalg.norm(np.asarray(sensors.up))
    return np.concatenate([views, (points.mean(axis=0) + FAR_AWAY * up)[None]])


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
