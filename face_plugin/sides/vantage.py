"""Where a scan without known sensors may have been seen from: for open scans, whose field is alike on both sides.

From any place that is not in matter, all that is visible faces it; from within matter nothing is seen, or all that is
seen faces away. So what is visible from one place lies on one side as a whole, and parts that no sheet joins, such as
a roof and the ground beside it, or a box and the floor behind it, learn of one another. Places tried are those that
scans are taken from: far off along the axes, and the emptiest place within.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.patches import Planes, planes_of
from face_plugin.sides.sensors import SIGHT, Sensors, facing, sights
from face_plugin.threads import KDTree

__all__ = ["is_open", "sides_from_vantage"]

# A scan is open where the field differs between the two sides by less than this, on average. On closed bodies one side
# is shielded at nearly every point (0.93 to 1.0 on sketches with gaps, CAD and scans all round; 0.5 to 0.91 on open
# scans that were generated or real).
SHIELDED = 0.92
# Fewer points show no sheet that could be open.
FEWEST = 100
# A place counts where it sees most of the points, face on: share of points, times the cosine, times how many agree.
WORTH = 0.6
# Cells along each axis among which the emptiest place is looked for.
GRID = 14


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
    """Turn normals (n, 3) to be on one side as seen from the best place; as they are where no place is good.

    Which of the two sides that is, most of the normals decide. `planes` are those of `around`, where they are known.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    >>> two = np.stack([x.ravel(), y.ravel(), np.where(x.ravel() < 10, 0.0, 5.0)], axis=1)
    >>> mixed = np.outer(np.where(two[:, 2] > 1, -1.0, 1.0), [0.0, 0.0, 1.0])
    >>> mixed[:20] *= -1.0
    >>> turned = sides_from_vantage(Neighbourhood(two + 0.01 * np.sin(two[:, ::-1])), mixed)
    >>> abs(turned[:, 2].mean())
    1.0
    """
    lines, edges, coupling = planes or planes_of(around)
    best, score = None, WORTH
    for place in _places(around.points):
        evidence = facing(lines, sights(around, place))
        # No more than what is seen at all: most places need no more looking at.
        if np.abs(evidence).mean() <= score:
            continue
        sign = cluster_signs(len(around), edges, coupling, SIGHT * evidence)
        reached = float((evidence * sign).mean())
        if reached > score:
            best, score = sign, reached
    if best is None:
        return normals
    side = np.where(np.einsum("nd,nd->n", lines * best[:, None], normals) < 0, -1.0, 1.0)
    return np.asarray(normals * (side if side.sum() >= 0 else -side)[:, None])


def _places(points: NDArray[np.float64]) -> list[Sensors]:
    axes = [Sensors(up=sign * axis) for axis in np.eye(3) for sign in (1.0, -1.0)]
    return [*axes, Sensors(_emptiest(points))]


def _emptiest(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find the place (1, 3) within the box of the points that is farthest from all of them."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    middles = (np.arange(GRID) + 0.5) / GRID
    share = np.stack(np.meshgrid(middles, middles, middles, indexing="ij"), axis=-1).reshape(-1, 3)
    place = lower + share * (upper - lower)
    return np.asarray(place[[np.argmax(KDTree(points).query(place)[0])]])
