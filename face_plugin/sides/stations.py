"""Where the scanner of a single view stood, told by how the density of its points falls off.

The rays of a scanner are even in angle: at the distance d, and at the angle t to the normal, each has the area
d^2 / cos t of the surface for itself. So the spacing of a single view tells where it was taken from, without any hint.
Clouds of even spacing, of several views, or thinned to a grid are not like that from anywhere.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.facing import facing
from face_plugin.sides.sensors import Sensors
from face_plugin.sides.sights import sights

__all__ = ["find_station", "sights_from_station"]

# A station is believed where the logarithms of area are nearer to what it says than to one another by this, by medians:
# 0.1 to 0.6 on single views, generated and real (0.82 on one), 0.75 and more on several, 1.1 and more on objects.
EXPLAINED = 0.7
# Points that places are looked for with.
LOOKED_WITH = 2000
# Places tried along each axis, over the box and so much of its extent around it.
PLACES, AROUND = 7, (0.25, 1.5)
# The best of each kind move as long as they get better, at most so many times: first and last step, in extents.
BEST, FIRST_STEP, LAST_STEP, MOVES = 4, 0.1, 0.002, 100
# Places tried above and below one in EVERY of the densest of the points, which are one in DENSEST, in extents.
DENSEST, EVERY, HEIGHTS = 20, 5, (0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2)
# Places that explain it nearly as well, as those of other heights over the ground do, are told apart by how many points
# are seen from them, and how squarely.
NEARLY = 2.0
# A ray that meets the surface at a smaller cosine is as good as along it.
GRAZING = 0.05


def find_station(around: Neighbourhood, lines: NDArray[np.float64]) -> Sensors | None:
    """Find the place from which a cloud was scanned, where it was a single one.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    lines : (n, 3) float64
        Unit normals, of either sign.

    Examples
    --------
    >>> ray = np.random.default_rng(0).normal(size=(6000, 3))
    >>> ray = ray[ray[:, 2] < -0.4 * np.linalg.norm(ray, axis=1)]
    >>> floor = ray / -ray[:, 2:] + np.array([0.0, 0.0, 1.0])  # seen from a height of 1
    >>> station = find_station(Neighbourhood(floor), np.tile([0.0, 0.0, 1.0], (len(ray), 1)))
    >>> bool(np.allclose(np.abs(station.viewpoints), [[0.0, 0.0, 1.0]], atol=0.2))  # it, or its mirror image
    True
    """
    some = np.unique(np.linspace(0, len(around) - 1, LOOKED_WITH).astype(np.intp))
    points, across, area = around.points[some], lines[some], 2.0 * np.log(around.spacing[some])
    lower, upper = points.min(axis=0), points.max(axis=0)
    extent = float((upper - lower).max())

    def left(place: NDArray[np.float64]) -> float:
        offset = points - place
        squared = np.maximum(np.einsum("nd,nd->n", offset, offset), np.finfo(float).tiny)
        cosine = np.abs(np.einsum("nd,nd->n", offset, across)) / np.sqrt(squared)
        return _spread(area - np.log(squared / np.maximum(cosine, GRAZING)))

    # Over the box and around it; and above and below where points lie densest, which is near the station.
    steps = np.stack(np.meshgrid(*3 * [np.linspace(-1.0, 1.0, PLACES)], indexing="ij"), axis=-1).reshape(-1, 3)
    dense = np.argsort(area)[: max(len(area) // DENSEST, 1)][::EVERY]
    boxes = [(lower + upper) / 2 + ((upper - lower) / 2 + wider * extent) * steps for wider in AROUND]
    heights = np.concatenate([HEIGHTS, np.negative(HEIGHTS)])
    found = []
    for near in (*boxes, (points[dense] + np.multiply.outer(heights, extent * across[dense])).reshape(-1, 3)):
        rest = np.array([left(place) for place in near])
        found += [_climbed(near[k], rest[k], extent, left) for k in np.argsort(rest)[:BEST]]
    least = min(rest for _, rest in found)
    if least >= EXPLAINED * _spread(area):
        return None
    # On the ground the area goes with d^3 over the height: that one is not told by it, nor is above from below.
    best = min(found, key=lambda one: one[1])[0]
    upright = np.linalg.eigh(across[dense].T @ across[dense])[1][:, 2]
    foot = best - ((best - points[dense].mean(axis=0)) @ upright) * upright
    found += [(place, left(place)) for place in foot + np.multiply.outer(heights, extent * upright)]
    # What stands on the ground is to be seen from above it.
    few = Neighbourhood(points)

    def seen(place: NDArray[np.float64]) -> float:
        toward = sights(few, Sensors(place), across)
        return float(toward.any(axis=1).mean() * np.abs(facing(across, toward)).mean())

    return Sensors(max((place for place, rest in found if rest <= NEARLY * least), key=seen)[None])


def sights_from_station(around: Neighbourhood, lines: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Directions (n, 3) in which points were seen from the station that their density tells, as `sights` has them.

    None where it tells none. Not for closed bodies: their field tells more, and they may have been sampled by rays from
    their middle.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(1000)
    >>> sights_from_station(Neighbourhood(ball.points), ball.normals) is None
    True
    """
    station = find_station(around, lines)
    return None if station is None else sights(around, station, lines)


def _climbed(
    place: NDArray[np.float64], least: float, extent: float, left: Callable[[NDArray[np.float64]], float]
) -> tuple[NDArray[np.float64], float]:
    """Move a place (3,) along the axes for as long as less is left unexplained."""
    step = FIRST_STEP
    for _ in range(MOVES):
        tried = [place + sign * step * extent * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
        rest = [left(one) for one in tried]
        if min(rest) < least:
            place, least = tried[int(np.argmin(rest))], min(rest)
        elif step <= LAST_STEP:
            break
        else:
            step /= 2
    return place, least


def _spread(values: NDArray[np.float64]) -> float:
    """Median distance from the median."""
    return float(np.median(np.abs(values - np.median(values))))
