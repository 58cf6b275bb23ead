"""Where a scan without known sensors may have been seen from: for open scans, whose field is alike on both sides.

From any place that is not in matter, all that is visible faces it; from within matter nothing is seen, or all that is
seen faces away. So what is visible from one place lies on one side as a whole, and parts that no sheet joins, such as
a roof and the ground beside it, or a box and the floor behind it, learn of one another. Places tried are those that
see most of a small part of the points: the sensor of a single view is one of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from face_plugin.geometry import evenly, lattice
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.facing import facing
from face_plugin.sides.patches import Planes, planes_of
from face_plugin.sides.sensors import Sensors
from face_plugin.sides.settling import settled_signs
from face_plugin.sides.sights import sights

__all__ = ["is_open", "sides_from_vantage"]

# A scan is open where the field differs between the two sides by less than this, on average. On closed bodies one side
# is shielded at nearly every point (0.93 to 1.0 on sketches with gaps, CAD and scans all round; 0.5 to 0.91 on open
# scans that were generated or real).
SHIELDED = 0.92
# Fewer points show no sheet that could be open.
FEWEST = 100
# A place counts where it sees most of the points, face on: share of points, times the cosine, times how many agree.
WORTH = 0.5
# Where couplings alone, without field and winding number, tell the same sides at 98 of 100 points (mean sign), a place
# must see more to turn parts of any size. Else what it sees of the other side counts against it: from beyond a wall of
# a street most of that is seen as well, and the wall from behind.
AGREED, WORTH_AGREED = 0.96, 0.75
# A place nearby must be clearly better than a direction from afar: a little better is chance.
NEAR = 0.98
# Points that places are looked for with.
LOOKED_WITH = 700
# Places tried along each axis, over so much of the box; those that then move are the best that are so far apart, in
# halves of the extent.
WIDE, WITHIN = 5, 0.9
TRIED, APART = 2, 0.3
# Steps of a place towards a better one, as fractions of the cloud's extent.
STEPS = (0.1, 0.05)
# A place moves by no more than so many steps of each length: far off, each step farther sees a little more.
MOVES = 4


def is_open(difference: NDArray[np.float64]) -> bool:
    """Whether the field of a cloud is so alike on both sides of its points that it encloses nothing.

    Parameters
    ----------
    difference : (n,) float64
        How far the two sides of each point differ, in [0, 1], as `FieldAtPoints.difference` has it.
    """
    return len(difference) > FEWEST and bool(difference.mean() < SHIELDED)


def sides_from_vantage(
    around: Neighbourhood, normals: NDArray[np.float64], planes: Planes | None = None
) -> NDArray[np.float64]:
    """Find normals (n, 3) on one side as seen from the best place; on that of those given where no place is good.

    That is the side that faces the place. Parts that are on the other side are turned where that is better than leaving
    them: where more is seen of them than couples them to the rest. Lines are those of planes: of them sides are told.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64
        Unit normals.
    planes : Planes, optional
        Those of `around`, where they are known.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    >>> two = np.stack([x.ravel(), y.ravel(), np.where(x.ravel() < 10, 0.0, 5.0)], axis=1)
    >>> mixed = np.outer(np.where(two[:, 2] > 1, -1.0, 1.0), [0.0, 0.0, 1.0])
    >>> mixed[:20] *= -1.0
    >>> turned = sides_from_vantage(Neighbourhood(two + 0.01 * np.sin(two[:, ::-1])), mixed)
    >>> bool(abs(turned[:, 2].mean()) > 0.999)
    True
    """
    lines, edges, coupling, _ = (planes or planes_of(around)).along(normals)
    joined = cluster_signs(len(around), edges, coupling)
    agreed = abs(float(joined.mean())) > AGREED
    best, score = np.ones(len(around)), WORTH * NEAR
    for place in _places(around.points, lines * joined[:, None]):
        evidence = facing(lines, sights(around, place, lines))
        weight = NEAR if place.up is None else 1.0
        seen = weight * float(np.abs(evidence).mean())
        # No more than what is seen at all: most places need no more looking at.
        if seen <= score:
            continue
        # The sides that are known may all be those of the back: what is turned then is turned from that.
        whole = 1.0 if evidence.sum() >= 0 else -1.0
        sign, worth = settled_signs(edges, coupling, whole * evidence, joined)
        if agreed and seen <= WORTH_AGREED * NEAR:
            worth = abs(float((evidence * joined).mean()))
        if weight * worth > score:
            best, score = whole * sign, weight * worth
    return np.asarray(lines * best[:, None])


def _places(points: NDArray[np.float64], normals: NDArray[np.float64]) -> list[Sensors]:
    """Find the places that see the most of the points (n, 3), the best first.

    Tried are 26 directions from afar, by what they see face on; and places within the box and around it, by how much
    more they see of one side of the normals (n, 3) than of the other. The best of these move for as long as they get
    better, so that one near the sensor of a single view ends there.
    """
    some = evenly(len(points), LOOKED_WITH)
    around, few = Neighbourhood(points[some]), normals[some]

    def share(place: Sensors) -> float:
        return float(np.abs(facing(few, sights(around, place, few))).mean())

    def one_sided(place: Sensors) -> float:
        return abs(float(facing(few, sights(around, place, few)).mean()))

    directions = lattice(3)[lattice(3).any(axis=1)]
    lower, upper = points.min(axis=0), points.max(axis=0)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    far = max(directions, key=lambda direction: share(Sensors(up=direction)))
    starts = np.vstack([middle + WITHIN * half * lattice(WIDE), middle + half.max() * directions])
    starts = starts[np.argsort([-one_sided(Sensors(start)) for start in starts])]
    apart = np.linalg.norm(starts - starts[0], axis=1) > APART * half.max()
    starts = np.vstack([starts[:1], starts[apart][: TRIED - 1]])
    near = [_climbed(start, one_sided, 2 * float(half.max())) for start in starts]
    places = [(share(Sensors(up=far)), Sensors(up=far)), (share(Sensors(up=-far)), Sensors(up=-far))]
    places += [(NEAR * one_sided(Sensors(place)), Sensors(place)) for place in near]
    return [place for _, place in sorted(places, key=lambda found: -found[0])]


def _climbed(place: NDArray[np.float64], share: Callable[[Sensors], float], extent: float) -> NDArray[np.float64]:
    """Move a place (3,) along the axes for as long as it sees more."""
    best = share(Sensors(place))
    for step in STEPS:
        for _ in range(MOVES):
            tried = [place + sign * step * extent * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
            seen = [share(Sensors(one)) for one in tried]
            if max(seen) <= best:
                break
            place, best = tried[int(np.argmax(seen))], max(seen)
    return place
