"""Curves in the plane with exact truth: closed ones, some of which cross or lie in one another, and an open one.

Curves are polygons of many sides; points are spread along them, evenly or at random.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from face_plugin.shapes.shape import Shape

__all__ = ["along", "circle", "gear", "letter", "nested_circles", "spiral", "star", "two_circles"]

Corners = NDArray[np.float64]
# Sides of a smooth curve: the normals of its polygon are right to 0.02 degrees.
SIDES = 10_000


def along(curves: Sequence[Corners], n: int, seed: int = 0, *, even: bool = True, closed: bool = True) -> Shape:
    """Spread points along polygons, each of which bounds a body.

    Parameters
    ----------
    curves : sequence of (c, 2) float64
        Corners of each, counter-clockwise: outward is to the right.
    n : int
        Number of points, at least 1.
    seed : int
        Of the random numbers.
    even : bool
        Points at equal distances along the curves, from a random start; or each at random.
    closed : bool
        Whether the last corner is joined to the first.

    Returns
    -------
    Shape
        With points and normals (n, 2). What lies inside another of the curves is interior; `depth` is its distance to
        the nearest corner of those curves.

    Raises
    ------
    ValueError
        `n` is below 1, or `curves` is empty.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    >>> shape = along([square], 100)
    >>> shape.points.shape, sorted(set(np.abs(shape.normals).sum(axis=1).tolist()))
    ((100, 2), [1.0])
    """
    if n < 1:
        raise ValueError(f"n: found {n}, allowed is 1 or more")
    if not curves:
        raise ValueError("curves: found none, allowed is one or more")
    rng = np.random.default_rng(seed)
    starts = [curve if closed else curve[:-1] for curve in curves]
    ends = [np.roll(curve, -1, axis=0) if closed else curve[1:] for curve in curves]
    owner = np.repeat(np.arange(len(curves)), [len(start) for start in starts])
    start, side = np.concatenate(starts), np.concatenate(ends) - np.concatenate(starts)
    length = np.linalg.norm(side, axis=1)
    until = np.cumsum(length)
    place = (np.arange(n) + rng.random()) / n if even else np.sort(rng.random(n))
    row = np.searchsorted(until, place * until[-1], side="right").clip(max=len(side) - 1)
    share = (place * until[-1] - (until[row] - length[row])) / length[row]
    points = start[row] + share[:, None] * side[row]
    direction = side[row] / length[row, None]
    normals = np.stack([direction[:, 1], -direction[:, 0]], axis=1)
    depth = np.zeros(n)
    for k, curve in enumerate(curves) if closed else ():
        others = np.flatnonzero(owner[row] != k)
        depth[others] = np.maximum(depth[others], _depth(points[others], curve))
    return Shape(points, normals, depth > 0, depth)


def _depth(points: NDArray[np.float64], curve: Corners) -> NDArray[np.float64]:
    """Distance (n,) of points within a polygon to its nearest corner, 0 outside: they are inside by odd crossings."""
    following = np.roll(curve, -1, axis=0)
    out = np.zeros(len(points))
    for k, (x, y) in enumerate(points):
        cuts = (curve[:, 1] > y) != (following[:, 1] > y)
        (ax, ay), (bx, by) = curve[cuts].T, following[cuts].T
        if np.count_nonzero(ax + (y - ay) / (by - ay) * (bx - ax) > x) % 2:
            out[k] = np.hypot(curve[:, 0] - x, curve[:, 1] - y).min()
    return out


def _polar(radius: NDArray[np.float64], angle: NDArray[np.float64]) -> Corners:
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _turn() -> NDArray[np.float64]:
    return np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)


def _ring(radius: float = 1.0, x: float = 0.0) -> Corners:
    return np.asarray(_polar(np.full(SIDES, radius), _turn()) + np.array([x, 0.0]))


def circle(n: int, seed: int = 0, *, even: bool = True) -> Shape:
    """Circle of radius 1.

    Examples
    --------
    >>> ring = circle(50)
    >>> bool(((ring.points * ring.normals).sum(axis=1) > 0.999).all())
    True
    """
    return along([_ring()], n, seed, even=even)


def star(n: int, seed: int = 0, *, arms: int = 5, depth: float = 0.3, even: bool = True) -> Shape:
    """Smooth star: a circle whose radius waves by `depth`, once for each arm.

    Examples
    --------
    >>> star(50).points.shape
    (50, 2)
    """
    angle = _turn()
    return along([_polar(1.0 + depth * np.cos(arms * angle), angle)], n, seed, even=even)


def gear(n: int, seed: int = 0, *, teeth: int = 12, height: float = 0.2, even: bool = True) -> Shape:
    """Gear of square teeth, its sides along radii and circles.

    Examples
    --------
    >>> gear(200).points.shape
    (200, 2)
    """
    angle = _turn()
    up = np.sin(teeth * angle) >= 0
    return along([_polar(np.where(up, 1.0, 1.0 - height), angle)], n, seed, even=even)


def letter(n: int, seed: int = 0, *, slot: float = 0.1, even: bool = True) -> Shape:
    """Letter E of height 1, between whose arms are slots of this width.

    Examples
    --------
    >>> letter(200).points.shape
    (200, 2)
    """
    arm = (1.0 - 2.0 * slot) / 3.0
    heights = [arm, arm + slot, 2 * arm + slot, 2 * arm + 2 * slot]
    right, inner = 0.6, 0.2
    corners = [(0.0, 0.0), (right, 0.0)]
    for low, high in (heights[:2], heights[2:]):
        corners += [(right, low), (inner, low), (inner, high), (right, high)]
    return along([np.array([*corners, (right, 1.0), (0.0, 1.0)])], n, seed, even=even)


def two_circles(n: int, seed: int = 0, *, apart: float = 1.2, even: bool = True) -> Shape:
    """Two circles of radius 1 that cross; the arcs within the other are interior.

    Examples
    --------
    >>> float(two_circles(1000).interior.mean().round(2))
    0.3
    """
    return along([_ring(), _ring(x=apart)], n, seed, even=even)


def nested_circles(n: int, seed: int = 0, *, radius: float = 0.5, even: bool = True) -> Shape:
    """Circle within a circle of radius 1: a body inside another, all of it interior.

    Examples
    --------
    >>> shape = nested_circles(300)
    >>> bool((shape.interior == (np.linalg.norm(shape.points, axis=1) < 0.8)).all())
    True
    """
    return along([_ring(), _ring(radius)], n, seed, even=even)


def spiral(n: int, seed: int = 0, *, turns: float = 2.5, even: bool = True) -> Shape:
    """Spiral of Archimedes, open: both of its sides are free, and its normals point away from the middle.

    Examples
    --------
    >>> spiral(50).points.shape
    (50, 2)
    """
    angle = np.linspace(0.5 * np.pi, 2.0 * np.pi * turns, SIDES)
    return along([_polar(angle / angle[-1], angle)], n, seed, even=even, closed=False)
