"""Bodies within bodies, read as cavities: every other one from outside in faces inward, by parity of enclosure.

Points do not tell whether a shell inside another is the wall of a cavity or a body of its own: who scanned them does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import Neighbourhood

__all__ = ["Nesting", "cavities"]

# Mean winding number of the others of a part at its points, in absolute value, from which the part is closed: 1/2 on a
# closed surface, 0.35 at the pole of half a sphere, and less at its rim.
CLOSED = 0.4
# Winding number of a part from which what lies there is inside it.
WITHIN = 0.5
# Fewer points are no body.
FEWEST = 20
# Width of the kernel of the winding number, in spacings.
WIDTH = 0.3


@dataclass(frozen=True)
class Nesting:
    """What is to be done to bodies that lie within others, to read them as cavities."""

    turned: NDArray[np.bool_]
    """(n,) normals to turn round."""
    inner: NDArray[np.bool_]
    """(n,) points of bodies within others."""


def cavities(
    around: Neighbourhood,
    normals: NDArray[np.float64],
    part: NDArray[np.intp],
    known: NDArray[np.bool_] | None = None,
) -> Nesting:
    """Find which closed parts lie within others, and which of them must be turned for sides to alternate inward.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, d) float64
        Unit normals, of one side on each part.
    part : (n,) intp
        As `face_plugin.sides.parts.parts` has it.
    known : (n,) bool, optional
        Points whose side is known, such as those that a sensor saw: parts with such points are not turned.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> outer, inner = sphere(800), sphere(400, radius=0.5)
    >>> points, out = (np.concatenate([getattr(outer, of), getattr(inner, of)]) for of in ("points", "normals"))
    >>> found = cavities(Neighbourhood(points), out, np.repeat([0, 1], [800, 400]))
    >>> bool(found.turned[800:].all()), bool(found.turned[:800].any())
    (True, False)
    """
    count = np.bincount(part)
    large = np.flatnonzero(count >= FEWEST)
    rows = {int(k): np.flatnonzero(part == k) for k in large}
    lower, upper = (np.array([of(around.points[rows[k]], axis=0) for k in rows]) for of in (np.min, np.max))
    name = np.array(list(rows), dtype=np.intp)
    # Only what has the other in its box can have it inside.
    holds = {}
    for k, low, high in zip(rows, lower, upper, strict=True):
        within = (lower > low).all(axis=1) & (upper < high).all(axis=1)
        holds[k] = [int(other) for other in name[within]]
    involved = {*(k for k in holds if holds[k]), *(other for others in holds.values() for other in others)}
    side: dict[int, float] = {}
    outer: dict[int, list[int]] = {k: [] for k in involved}
    for k in sorted(involved):
        asked = np.concatenate([rows[j] for j in (k, *holds[k])])
        width = np.zeros(len(around))
        width[asked] = WIDTH * around.spacing[asked]
        own = np.where((part == k)[:, None], normals, 0.0)
        number = around.tree.outward_and_number(own, width)[1]
        if np.abs(number[rows[k]]).mean() < CLOSED:
            continue
        side[k] = float(np.sign(number[rows[k]].mean()))
        for other in holds[k]:
            if np.median(np.abs(number[rows[other]])) > WITHIN:
                outer[other].append(k)
    turned, inner = np.zeros(int(count.size), dtype=np.bool_), np.zeros(int(count.size), dtype=np.bool_)
    # From outside in: the part directly around is the one that lies within the most others.
    for k in sorted(side, key=lambda k: len(outer[k])):
        if not outer[k]:
            continue
        inner[k] = True
        nearest = max(outer[k], key=lambda j: len(outer[j]))
        if side[k] == side[nearest] and not (known is not None and known[rows[k]].any()):
            turned[k], side[k] = True, -side[k]
    return Nesting(turned[part], inner[part])
