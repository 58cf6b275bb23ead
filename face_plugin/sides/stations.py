"""Where the scanners of a cloud stood, told by how the density of its points falls off, without any hint.

Clouds of even spacing, thinned to a grid, or of many views are not like that from anywhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from face_plugin.geometry import lattice
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.facing import facing
from face_plugin.sides.ray_density import RayDensity
from face_plugin.sides.sensors import Sensors
from face_plugin.sides.sights import sights

__all__ = ["CHANCE", "LOOKED_WITH", "find_stations"]

# Stations are believed where the logarithms of area are nearer to what they say than to one another by this, by
# medians: 0.02 to 0.7 on one to four views, generated and real; 0.7 to 1.0 on eight and more, on what a camera saw from
# all round, and on clouds thinned to a grid; 0.95 and more on objects. Areas that scatter no more than by chance must
# be nearer: 0.13 to 0.6 on what a camera saw from afar, 0.64 and more on thinned clouds.
EXPLAINED, BY_CHANCE = 0.7, 0.6
# Areas scatter as much by chance alone, 0.3 to 0.36 where points lie at random, and to 0.4 where one is kept of each
# cell of a grid: less tells nothing of several views, nor of what looks closed.
CHANCE = 0.41
# No more of them are looked for, and no more than leave this much less unexplained than fewer do.
MOST, FEWER = 4, 0.95
# Points that places are looked for with.
LOOKED_WITH = 2000
# The box that they are looked for in leaves out as many as this, or strays that are left would stretch it.
WITHIN = (0.01, 0.99)
# Places tried along each axis, over the box and so much of its extent around it.
PLACES, AROUND = (9, 5, 5), (0.0, 0.25, 1.5)
# Where several are looked for, the search starts with so many, so far apart in extents.
START, APART = 6, 0.12
# The best of each kind move as long as they get better, at most so many times: first and last step, in extents, and the
# last while it is only asked which of several are missed least.
BEST, FIRST_STEP, LAST_STEP, ROUGHLY, MOVES = 2, 0.1, 0.002, 0.01, 100
# Places tried above and below one in EVERY of the densest of the points, which are one in DENSEST, in extents.
DENSEST, EVERY, HEIGHTS = 20, 5, (0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2)
# Places that explain it nearly as well, as those of other heights over the ground do, or well enough, are told apart by
# how many points are seen from them, and where that is alike, by how squarely.
NEARLY, ENOUGH, ALIKE = 2.0, 0.2, 0.97
# As much is seen of flat ground from its mirror image: twice as squarely counts as 1.4 % more in sight.
SQUARELY = 0.02


def find_stations(seen: RayDensity) -> Sensors | None:
    """Find the places from which a cloud was scanned, where there were few.

    The density is a sum over stations. Non-negative least squares over places everywhere tells about where they are;
    then each moves for as long as less is left unexplained.

    Parameters
    ----------
    seen : RayDensity
        About `LOOKED_WITH` points of the cloud.

    Examples
    --------
    >>> ray = np.random.default_rng(0).normal(size=(6000, 3))
    >>> ray = ray[ray[:, 2] < -0.4 * np.linalg.norm(ray, axis=1)]
    >>> floor = Neighbourhood(ray / -ray[:, 2:] + np.array([0.0, 0.0, 1.0]))  # seen from a height of 1
    >>> station = find_stations(RayDensity.of(floor, np.tile([0.0, 0.0, 1.0], (1000, 1)), np.arange(1000)))
    >>> bool(np.allclose(np.abs(station.viewpoints), [[0.0, 0.0, 1.0]], atol=0.2))  # it, or its mirror image
    True
    """
    box = np.quantile(seen.points, WITHIN, axis=0)
    extent = float(np.ptp(box, axis=0).max())
    places = [*_over_the_box(box, extent), _near_the_densest(seen, extent)]
    singles = []
    for some in places:
        rest = seen.left(seen.expected(some))
        singles += [_climbed(seen, some[k : k + 1], extent) for k in np.argsort(rest)[:BEST]]
    tried = [min(singles, key=lambda one: one[1])]
    # Rows do not add up; and what one station explains needs no others.
    summed = seen.but_rows()
    several = seen.spread > CHANCE and 2 * len(summed.points) > len(seen.points)
    if several and tried[0][1] > 0.5 * EXPLAINED * seen.spread:
        tried += _several(summed, np.vstack(places[:-2]), extent)
    found, unexplained = next(one for one in tried if FEWER * one[1] <= min(rest for _, rest in tried))
    if unexplained >= (EXPLAINED if seen.spread > CHANCE else BY_CHANCE) * seen.spread:
        return None
    if len(found) > 1:
        found = _on_one_side(seen, found, unexplained)
        return Sensors(_adjusted(summed, found, unexplained, extent))
    return Sensors(_at_its_height(seen, singles, found, unexplained, extent))


def _over_the_box(box: NDArray[np.float64], extent: float) -> list[NDArray[np.float64]]:
    """Places (k, 3) over a box, of which opposite corners (2, 3) are given, and around it."""
    middle, half = box.mean(axis=0), np.ptp(box, axis=0) / 2
    return [middle + (half + wider * extent) * lattice(wide) for wide, wider in zip(PLACES, AROUND, strict=True)]


def _near_the_densest(seen: RayDensity, extent: float) -> NDArray[np.float64]:
    """Places (k, 3) above and below where points lie densest, which is near the station."""
    dense = _densest(seen)[::EVERY]
    offset = np.multiply.outer([*HEIGHTS, *np.negative(HEIGHTS)], extent * seen.across[dense])
    return np.asarray((seen.points[dense] + offset).reshape(-1, 3))


def _densest(seen: RayDensity) -> NDArray[np.intp]:
    return np.argsort(seen.area)[: max(len(seen.area) // DENSEST, 1)]


def _several(seen: RayDensity, places: NDArray[np.float64], extent: float) -> list[tuple[NDArray[np.float64], float]]:
    """Find sets of two to `MOST` stations, and what each leaves unexplained, from places (k, 3) to start at."""
    few = seen.part(slice(None, None, 2))
    share = (np.exp(few.area) * few.expected(places)).T
    try:
        strength = nnls(share, np.ones(len(share)), maxiter=10 * len(places))[0] * share.mean(axis=0)
    except RuntimeError:
        # It came to no end: nothing is told then.
        return []
    chosen: list[int] = []
    for k in np.argsort(-strength):
        if all(np.linalg.norm(places[k] - places[other]) > APART * extent for other in chosen):
            chosen.append(int(k))
        if len(chosen) == START:
            break
    fewest = few.part(slice(None, None, 2))
    sets = [_climbed(fewest, places[chosen], extent, ROUGHLY)[0]]
    while len(sets[-1]) > 2:
        # Without the one that is missed least, the others may do as well.
        fewer = [np.delete(sets[-1], k, axis=0) for k in range(len(sets[-1]))]
        sets.append(min((_climbed(fewest, some, extent, ROUGHLY) for some in fewer), key=lambda one: one[1])[0])
    return [_climbed(seen, some, extent) for some in sets[::-1] if len(some) <= MOST]


def _climbed(
    seen: RayDensity, places: NDArray[np.float64], extent: float, last: float = LAST_STEP
) -> tuple[NDArray[np.float64], float]:
    """Move places (k, 3) along the axes, in turns, for as long as less is left unexplained; that is told as well."""
    places, axes, step = places.copy(), np.vstack([np.eye(3), -np.eye(3)]), FIRST_STEP
    density = seen.expected(places)
    least = float(seen.left(density.sum(axis=0)))
    for _ in range(MOVES):
        before = least
        for k in range(len(places)):
            tried = places[k] + step * extent * axes
            there = seen.expected(tried)
            rest = seen.left(np.delete(density, k, axis=0).sum(axis=0) + there)
            best = int(np.argmin(rest))
            if rest[best] < least:
                places[k], density[k], least = tried[best], there[best], float(rest[best])
        if least == before:
            if step <= last:
                break
            step /= 2
    return places, least


def _ground(seen: RayDensity) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find a place (3,) and the unit normal (3,) of the plane where points lie densest."""
    dense = _densest(seen)
    return seen.points[dense].mean(axis=0), np.linalg.eigh(seen.across[dense].T @ seen.across[dense])[1][:, 2]


def _worth(seen: RayDensity, few: Neighbourhood, places: NDArray[np.float64], rest: float) -> tuple[float, float]:
    """How many points are seen from places (k, 3), times how much of their density is explained; and how squarely."""
    toward = sights(few, Sensors(places), seen.across)
    share = float(toward.any(axis=1).mean()) * (1.0 - rest / seen.spread)
    return share, float(np.abs(facing(seen.across, toward)).mean())


def _on_one_side(seen: RayDensity, stations: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Mirror stations (k, 3) to one side of the ground, where that explains the density as well."""
    ground, upright = _ground(seen)
    height = (stations - ground) @ upright
    sets = [stations + np.multiply.outer(sign * np.abs(height) - height, upright) for sign in (1.0, -1.0)]
    few = Neighbourhood(seen.points)
    rest = [float(seen.left(seen.expected(places).sum(axis=0))) for places in sets]
    kept = [(places, left) for places, left in zip(sets, rest, strict=True) if FEWER * left <= least]
    return max(kept, key=lambda one: _worth(seen, few, *one))[0] if kept else stations


def _adjusted(seen: RayDensity, stations: NDArray[np.float64], least: float, extent: float) -> NDArray[np.float64]:
    """Move stations (k, 3) all together to where the logarithms fit best, unless by medians less is explained there."""

    def off(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        places = unknown[:-1].reshape(stations.shape)
        return np.asarray(seen.area + np.log(seen.expected(places).sum(axis=0)) - unknown[-1])

    factor = np.median(off(np.append(stations, 0.0)))
    scale = np.append(np.full(stations.size, FIRST_STEP * extent), seen.spread)
    fit = least_squares(off, np.append(stations, factor), loss="soft_l1", f_scale=CHANCE, x_scale=scale, max_nfev=MOVES)
    places = fit.x[:-1].reshape(stations.shape)
    rest = float(seen.left(seen.expected(places).sum(axis=0)))
    return np.asarray(places) if FEWER * rest <= least else stations


def _at_its_height(
    seen: RayDensity,
    singles: list[tuple[NDArray[np.float64], float]],
    best: NDArray[np.float64],
    least: float,
    extent: float,
) -> NDArray[np.float64]:
    """Of places that explain the density as well as the best (1, 3) and see as much, the one that sees most squarely.

    On the side of the ground from which most is seen.
    """
    # On the ground the area goes with d^3 over the height: that one is not told by it, nor is above from below.
    ground, upright = _ground(seen)
    foot = best[0] - ((best[0] - ground) @ upright) * upright
    others = foot + np.multiply.outer([*HEIGHTS, *np.negative(HEIGHTS)], extent * upright)
    places = np.vstack([*(place for place, _ in singles), others])
    rest = np.concatenate([[left for _, left in singles], seen.left(seen.expected(others))])
    few = Neighbourhood(seen.points)
    enough = max(NEARLY * least, ENOUGH * seen.spread)
    kept = np.flatnonzero(rest <= enough)
    worth = np.array([_worth(seen, few, places[k : k + 1], rest[k]) for k in kept])
    above = (places[kept] - ground) @ upright > 0
    side = above == above[int(np.argmax(worth[:, 0] * worth[:, 1] ** SQUARELY))]
    alike = side & (worth[:, 0] >= ALIKE * worth[side, 0].max())
    return places[kept[[int(np.argmax(np.where(alike, worth[:, 1], 0.0)))]]]
