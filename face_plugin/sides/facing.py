"""The sides that follow from what sensors saw.

A point that a sensor saw faces it: the space between was free. Each point leans to the sensors that see it, the more
the less it is seen at a slant; points that none sees, and grazing ones, take the side of the sheet that they are part
of.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import better_signs, cluster_signs
from face_plugin.sides.cuts import cut_signs
from face_plugin.sides.graph import couplings, neighbours_around
from face_plugin.sides.patches import Planes, planes_of

__all__ = ["SIGHT", "as_faced", "facing", "resettled", "sides_by_sensors"]

# Weight of a line of sight next to the couplings of a point to its neighbours, which are 1 at most each: a few false
# sights, through gaps, must not tear a sheet.
SIGHT = 0.5
# Lines seen at this sine of the angle to their planes count 0.7 of those seen face on: planes are known to about as
# much, and seen more squarely than that, a far floor faces the sensor as surely as a near wall.
GRAZING = 0.1
# Weight of the side that a line was given before its angle was known better.
KEPT = 0.25


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
        As `face_plugin.sides.sights.sights` has it.
    blind : (n, 3) float64, optional
        Normals found without sensors: where no sensor saw, they count, as far as they agree with what was seen
        elsewhere.
    planes : Planes, optional
        Those of `around`, where they are known.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> from face_plugin.sides.sensors import Sensors
    >>> from face_plugin.sides.sights import sights
    >>> ball = sphere(1000)
    >>> around = Neighbourhood(ball.points)
    >>> inward = sides_by_sensors(around, sights(around, Sensors([0.0, 0.0, 0.0]), ball.normals))
    >>> bool(((inward * ball.normals).sum(axis=1) < 0).all())
    True
    """
    lines, edges, coupling, _ = planes or planes_of(around)
    evidence = _evidence(lines, seen, blind)
    sign = cut_signs(cluster_signs(len(around), edges, coupling, evidence), edges, coupling, evidence)
    return np.asarray(lines * sign[:, None])


def as_faced(around: Neighbourhood, normals: NDArray[np.float64], faced: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn normals (n, 3) to the sides of others (n, 3), whole patches at a time.

    Sides by sensors come with the lines of planes, which mean nothing on rods and rims thinner than their neighbours
    reach. Of a closed body the normals found without sensors have better lines, and are only to be turned.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    normals : (n, 3) float64
        Unit normals, on one side within patches.
    faced : (n, 3) float64
        Unit normals on the right side.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(1000)
    >>> faced = np.where(np.arange(1000)[:, None] % 9 == 0, np.roll(ball.normals, 1, axis=1), -ball.normals)
    >>> turned = as_faced(Neighbourhood(ball.points), ball.normals, faced)
    >>> bool(((turned * ball.normals).sum(axis=1) < 0).all())
    True
    """
    return _turned(around, normals, SIGHT * np.einsum("nd,nd->n", faced, normals))


def _evidence(
    lines: NDArray[np.float64], seen: NDArray[np.float64], blind: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Weigh what tells the sides (n,) of lines: sights, and elsewhere normals found blind if the sights bear these out.

    A body seen from outside is what its field says it is, also where no sensor looks; a room is its opposite.
    """
    evidence = facing(lines, seen)
    evidence /= np.hypot(evidence, GRAZING)
    if blind is not None:
        agreed = facing(blind, seen)
        borne_out = max(float(agreed.sum() / max(np.abs(agreed).sum(), np.finfo(float).tiny)), 0.0)
        found = borne_out**2 * np.einsum("nd,nd->n", lines, blind)
        evidence = np.where(seen.any(axis=1), evidence, found)
    return np.asarray(SIGHT * evidence)


def resettled(
    around: Neighbourhood,
    normals: NDArray[np.float64],
    seen: NDArray[np.float64] | None = None,
    blind: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Settle the sides of normals (n, 3) of better angles again, along sheets and by what was seen (n, 3), if anything.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(1000)
    >>> astray = np.where(np.arange(1000)[:, None] % 50 == 0, -ball.normals, ball.normals)
    >>> bool((resettled(Neighbourhood(ball.points), astray) == ball.normals).all())
    True
    """
    evidence = np.full(len(around), KEPT)
    return _turned(around, normals, evidence if seen is None else evidence + _evidence(normals, seen, blind))


def _turned(around: Neighbourhood, normals: NDArray[np.float64], evidence: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn normals (n, 3) where evidence (n,) and what couples them to their neighbours say so together."""
    edges = neighbours_around(around, normals)
    coupling = couplings(around.points, normals, edges)
    sign = cut_signs(better_signs(len(around), edges, coupling, evidence), edges, coupling, evidence)
    return np.asarray(normals * sign[:, None])
