"""The stations of a cloud in tiles: each leaves some points as they were scanned, and the coarse points check them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.belief import believed_stations
from face_plugin.sides.patches import lines_at
from face_plugin.sides.ray_density import RayDensity
from face_plugin.sides.sensors import Sensors
from face_plugin.sides.stations import LOOKED_WITH
from face_plugin.tiles.store import Store

__all__ = ["as_scanned", "stations_of"]

_NAMES = tuple(field.name for field in dataclasses.fields(RayDensity))


def as_scanned(
    store: Store, tile: int, around: Neighbourhood, place: NDArray[np.intp], stray: NDArray[np.bool_]
) -> dict[str, NDArray[np.generic]]:
    """Take some of the points of a tile, as `RayDensity` has them, for the store to keep.

    Parameters
    ----------
    store : Store
    tile : int
    around : Neighbourhood
        Of the points in and around the tile that are no strays.
    place : (k,) intp
        Row there of each point that the tile owns.
    stray : (k,) bool
        Points that have no row.
    """
    # One in so many of all points, whichever tile they are in.
    step = -(-store.count // LOOKED_WITH)
    rows = np.arange(-store.start[tile] % step, len(place), step)
    some = place[rows[~stray[rows]]]
    seen = RayDensity.of(around, lines_at(around, some), some)
    return {f"scanned_{name}": getattr(seen, name) for name in _NAMES}


def stations_of(store: Store) -> Sensors | None:
    """Find the stations of a store, all of whose tiles have left what the field says, and the coarse points as well.

    In the canonical frame; None where there are none, as in one piece (`believed_stations`).
    """
    if not store.refines:
        return None
    found: dict[str, list[NDArray[Any]]] = {}
    for tile in range(store.tiles):
        for name, values in store.read(tile, "field", *(f"scanned_{name}" for name in _NAMES)).items():
            found.setdefault(name, []).append(values)
    seen = RayDensity(*(np.concatenate(found[f"scanned_{name}"]) for name in _NAMES))
    with np.load(store.folder / "far.npz") as far:
        around = Neighbourhood(far["points"])
        believed = believed_stations(around, seen, difference=far["difference"], strength=far["strength"])
    return None if believed is None else believed[0]
