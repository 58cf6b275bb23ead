"""Which stations that density tells are believed: they saw all of the cloud, and do not contradict one another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.geometry import evenly
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.enclosure import dim
from face_plugin.sides.facing import facing, sides_by_sensors
from face_plugin.sides.parts import several_parts
from face_plugin.sides.patches import Planes, planes_of
from face_plugin.sides.ray_density import RayDensity
from face_plugin.sides.sensors import Sensors
from face_plugin.sides.sights import sights
from face_plugin.sides.stations import CHANCE, LOOKED_WITH, find_stations
from face_plugin.sides.vantage import is_open

__all__ = ["believed_stations"]

# They have seen all there is, but for false shadows: 0.91 to 1 of the points, against 0.68 on a torus of rows.
# Sheets face them as a whole: 0.992 to 1, against 0.93 where too few were found for eight views of a table.
SEEN, AGREED = 0.85, 0.98
# One wrong among several sees a sheet from behind that others see from the front: what couples neighbours says so. Of
# that, 0 to 0.0026 is lost where all are right, against the best there is; 0.0039 to 0.0082 where one is wrong.
LOST = 0.0033


def believed_stations(
    around: Neighbourhood,
    seen: RayDensity | None = None,
    *,
    planes: Planes | None = None,
    difference: NDArray[np.float64] | None = None,
    strength: NDArray[np.float64] | None = None,
) -> tuple[Sensors, NDArray[np.float64]] | None:
    """Find the stations that the density of a cloud tells, and the directions in which points were seen from them.

    None where it tells none, and where too little is in sight of what it tells, or sides would be at odds along sheets.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    seen : RayDensity, optional
        Some of the points as they were scanned, where `around` is thinned.
    planes : Planes, optional
        Those of `around`, where they are known.
    difference, strength : (n,) float64, optional
        What the field says of the points, as of `FieldAtPoints`. A closed body may have been sampled by rays from its
        middle, and is not asked; a room is closed as well, but something stands in it: in the dark, or as a part of its
        own. By default the cloud is open.

    Returns
    -------
    tuple or None
        The stations, and directions (n, 3) as `sights` has them.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> believed_stations(Neighbourhood(sphere(1000).points)) is None
    True
    """
    planes = planes or planes_of(around)
    if seen is None:
        some = evenly(len(around), LOOKED_WITH)
        seen = RayDensity.of(around, planes.lines[some], some)
    if difference is not None and not is_open(difference):
        # Most bodies are evenly sampled, which is told at once.
        standing = strength is not None and bool(dim(strength).any())
        if seen.spread < CHANCE or not (standing or several_parts(around, planes.lines)):
            return None
    stations = find_stations(seen)
    if stations is None:
        return None
    stations = _in_accord(around, stations, planes.lines)
    toward = sights(around, stations, planes.lines)
    evidence = facing(planes.lines, toward)
    says = planes.coupling * evidence[planes.edges.first] * evidence[planes.edges.second]
    if toward.any(axis=1).mean() < SEEN or says.sum() < AGREED * np.abs(says).sum():
        return None
    if len(np.atleast_2d(np.asarray(stations.viewpoints))) > 1:
        best = _satisfied(planes, planes.lines * cluster_signs(len(around), planes.edges, planes.coupling)[:, None])
        if best - _satisfied(planes, sides_by_sensors(around, toward, planes=planes)) > LOST:
            return None
    return stations, toward


def _satisfied(planes: Planes, normals: NDArray[np.float64]) -> float:
    """How far normals (n, 3) satisfy what couples neighbours: 1 where all of it is, -1 where none is."""
    coupling = planes.along(normals).coupling
    return float(coupling.sum() / np.abs(coupling).sum())


def _in_accord(around: Neighbourhood, stations: Sensors, lines: NDArray[np.float64]) -> Sensors:
    """Leave out stations that see most of what they see from the other side than all others do.

    One of them is the mirror image, behind a wall, of a true one in front of it: 86 % and more of what it sees is seen
    from the other side, and of what true ones see 8 % and less.
    """
    places = np.atleast_2d(np.asarray(stations.viewpoints))
    if len(places) == 1:
        return stations
    faced = np.array([facing(lines, sights(around, Sensors(place), lines)) for place in places])
    while True:
        others = faced.sum(axis=0) - faced
        seen = np.abs(faced) * (others != 0)
        against = (seen * (faced * others < 0)).sum(axis=1) / np.maximum(seen.sum(axis=1), np.finfo(float).tiny)
        worst = int(np.argmax(against))
        if against[worst] <= 0.5:
            return Sensors(places)
        places, faced = np.delete(places, worst, axis=0), np.delete(faced, worst, axis=0)
