"""What the second stage of a tile sees: its ring in full, and the rest of the cloud the coarser the farther.

Winding numbers need the whole surface, but dipoles far away may stand for one another: points are thinned to
a fixed share of their distance. Those of the tiles around come from these; beyond, the points of the coarse
cage do.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from face_plugin import cloud
from face_plugin.faraday.gradient import FieldAtPoints
from face_plugin.geometry import unit
from face_plugin.sides.sheets import Sheets
from face_plugin.tiles.coarse import nearest_to_centres
from face_plugin.tiles.store import Store
from face_plugin.tiles.surroundings import surroundings

__all__ = ["Scene", "scene", "write_far"]

# Width of the full ring around a tile, in its spacings.
RING_WIDTH = 6.0
# Width of the part of it in which normals move.
NEAR = 3.0
# Size of the voxels that are left a point, as a share of the distance to the tile.
THINNED = 0.2
_SHEETS = tuple(field.name for field in dataclasses.fields(Sheets))
_FIELD = tuple(field.name for field in dataclasses.fields(FieldAtPoints))


@dataclass(frozen=True)
class Scene:
    """Distinct points in Morton order, with what the first stage found out."""

    points: NDArray[np.float64]
    """(n, 3) in the canonical frame."""
    field: FieldAtPoints
    own: NDArray[np.intp]
    """(k,) the row of each point that the tile owns."""
    stray: NDArray[np.bool_]
    """(n,) strays, which have no vote and do not move."""
    near: NDArray[np.bool_]
    """(n,) the tile's points, and those so near that their normals must be right for the tile's to be."""
    sheets: Sheets | None
    """Of the points `near`, 0 for others; None where normals are not refined."""


def write_far(store: Store) -> None:
    """Bring together what the first stage found out at the points of the coarse cage."""
    parts = []
    for tile in range(store.tiles):
        found = store.read(tile, "field", "voxel_rows", "stray", *_FIELD)
        rows = found["voxel_rows"]
        sound = ~found["stray"][rows]
        values = {name: found[name][rows[sound]] for name in _FIELD}
        parts.append({"points": store.voxels(tile)[sound], **values})
    store.write_whole("far", **{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


@lru_cache(maxsize=1)
def _far(folder: Path, key: str) -> dict[str, NDArray[np.float64]]:
    with np.load(folder / "far.npz") as arrays:
        return {name: arrays[name] for name in arrays.files}


def scene(store: Store, tile: int) -> Scene:
    """Collect what the second stage of a tile needs.

    Parameters
    ----------
    store : Store
        The first stage of all its tiles is done.
    tile : int
    """
    near = surroundings(store, tile, RING_WIDTH)
    reach = RING_WIDTH * near.spacing
    middle = store.within(near.lower - store.voxel / THINNED, near.upper + store.voxel / THINNED)
    far = _far(store.folder, store.key)

    def outside(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.maximum(np.maximum(near.lower - points, points - near.upper), 0.0).max(axis=1))

    distance = outside(middle.points)
    rows = _thinned(middle.points, distance, reach)
    beyond = np.flatnonzero(outside(far["points"]) > store.voxel / THINNED)
    beyond = beyond[_thinned(far["points"][beyond], outside(far["points"][beyond]), reach)]

    tiles = np.concatenate([near.tile, middle.tile[rows]])
    row_in_tile = np.concatenate([near.row, middle.row[rows]])
    found = _of_tiles(store, tiles, row_in_tile)
    points = np.concatenate([near.points, middle.points[rows], far["points"][beyond]])
    order, leads = cloud.morton_distinct(points)
    place = np.empty(len(order), dtype=np.intp)
    place[order] = np.cumsum(leads) - 1
    kept = order[leads]
    moving = NEAR * near.spacing - reach
    inside = (points[kept] >= near.lower - moving) & (points[kept] <= near.upper + moving)
    stray = np.concatenate([found["stray"].astype(np.bool_), np.zeros(len(beyond), dtype=np.bool_)])[kept]
    moves = np.asarray(inside.all(axis=1)) & ~stray

    def everywhere(name: str) -> NDArray[np.float64]:
        return np.concatenate([found[name], far[name][beyond]])[kept]

    def where_it_moves(name: str) -> NDArray[np.float64]:
        return np.where(moves, np.concatenate([found[name], np.zeros(len(beyond))])[kept], 0.0)

    return Scene(
        points[kept],
        FieldAtPoints(everywhere("strength"), unit(everywhere("normals")), everywhere("difference")),
        place[near.own],
        stray,
        moves,
        Sheets(*map(where_it_moves, _SHEETS)) if store.refines else None,
    )


def _of_tiles(store: Store, tile: NDArray[np.int64], row: NDArray[np.int64]) -> dict[str, NDArray[np.float64]]:
    """Read what the first stage found out about points, given by the tiles (n,) that own them and their rows there."""
    names = (*_FIELD, "stray", *(_SHEETS if store.refines else ()))
    out: dict[str, NDArray[np.float64]] = {}
    for other in np.unique(tile):
        mine = tile == other
        for name, values in store.read(int(other), "field", *names).items():
            out.setdefault(name, np.empty((len(tile), *values.shape[1:])))[mine] = values[row[mine]]
    return out


def _thinned(points: NDArray[np.float64], distance: NDArray[np.float64], reach: float) -> NDArray[np.intp]:
    """Rows left of points at these distances outside a box that itself reaches so far: octave by octave."""
    rows = [np.empty(0, dtype=np.intp)]
    near = reach
    farthest = reach + (float(distance.max()) if len(distance) else 0.0)
    while near <= farthest:
        # `distance` counts from the box, `near` from the tile in it.
        octave = np.flatnonzero((distance > near - reach) & (distance <= 2 * near - reach))
        rows.append(octave[nearest_to_centres(points[octave], np.full(3, -1.0), THINNED * near)])
        near *= 2.0
    return np.concatenate(rows)
