"""The second stage of a tile: what only the oriented points together can tell."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from face_plugin.faraday.gradient import ROUNDING
from face_plugin.refine import refine
from face_plugin.sides import enclosure
from face_plugin.sides.confidence import confidence
from face_plugin.tiles.scene import scene
from face_plugin.tiles.solve import one_thread
from face_plugin.tiles.store import Store

__all__ = ["POLISH_STAGES", "polish_tile"]

POLISH_STAGES = ("scene", "refine", "enclosure", "confidence")


def polish_tile(folder: str, tile: int) -> int:
    """Refine the normals of one tile of a store, and tell how far they can be trusted and what is enclosed.

    Parameters
    ----------
    folder : str
        Of the store; the first stage of all its tiles is done.
    tile : int

    Returns
    -------
    int
        The tile's number.
    """
    store = Store.load(Path(folder))
    if not store.done(tile, "normals"):
        with one_thread():
            store.write(tile, "normals", **_polish(store, tile))
    return tile


def _polish(store: Store, tile: int) -> dict[str, NDArray[np.generic]]:
    seconds: list[float] = []
    start = time.process_time()

    def clock() -> None:
        seconds.append(time.process_time() - start - sum(seconds))

    seen = scene(store, tile)
    clock()
    # As in one piece, the field has no vote where it is rounding.
    votes = np.where((seen.strength > ROUNDING)[:, None], seen.normals, 0.0)
    normals = seen.normals
    if store.plane is not None:
        normals = np.tile(store.plane, (len(seen.points), 1))
    elif store.refines:
        normals = refine(seen.points, votes, seen.strength, seen.near, seen.sheets)
    clock()
    found: dict[str, NDArray[np.generic]] = {"normals": normals[seen.own]}
    if store.interior:
        found["enclosed"] = enclosure.enclosed(seen.points, normals, seen.strength)[seen.own]
    clock()
    found["confidence"] = confidence(seen.points, votes, normals, seen.own)
    clock()
    return {**found, "seconds": np.array(seconds)}
