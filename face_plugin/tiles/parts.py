"""Connected parts of a cloud in tiles: found among the points of the coarse cage, which see all of it at once.

Parts nearer to one another than these points are count as one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.cloud import morton_distinct
from face_plugin.faraday.gradient import FieldAtPoints
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.nesting import Nesting, cavities
from face_plugin.sides.parts import borne_out, open_parts, parts, told_by
from face_plugin.threads import KDTree
from face_plugin.tiles.store import Store

__all__ = ["Known", "known_of"]


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of the parts, at the points of the coarse cage."""

    points: NDArray[np.float64]
    """(k, 3) in the canonical frame."""
    open: NDArray[np.bool_]
    """(k,) whether the part of each encloses nothing."""
    sides: NDArray[np.uint8]
    """(k,) what told the sides of its normals."""
    borne_out: NDArray[np.float64]
    """(k,) how far the field bears these out."""
    nesting: Nesting | None
    """Bodies within others, where they are cavities."""

    def nearest(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        """Row (n,) of the coarse point that each point is taken for."""
        return np.asarray(KDTree(self.points).query(points)[1])


def known_of(store: Store) -> Known:
    """Find the parts of a store whose tiles are all done."""
    tiles = [_of_tile(store, tile) for tile in range(store.tiles)]
    found = {name: np.concatenate([of[name] for of in tiles]) for name in tiles[0]}
    order, leads = morton_distinct(found["points"])
    found = {name: values[order[leads]] for name, values in found.items()}
    around, oriented = Neighbourhood(found["points"]), found["oriented"]
    part = parts(around, oriented)
    field = FieldAtPoints(found["strength"], found["normals"], found["difference"])
    opened = open_parts(part, field)
    seen = found["seen"] > 0 if "seen" in found else None
    nesting = None if store.params.nested == "solid" else cavities(around, oriented, part, seen)
    sides = told_by(part, opened, oriented, field, None if store.guessed else seen)
    return Known(around.points, opened, sides, borne_out(part, sides, oriented, field), nesting)


def _of_tile(store: Store, tile: int) -> dict[str, NDArray[np.float64]]:
    """Read what is known of the points of the coarse cage that a tile owns, without strays."""
    field = store.read(tile, "field", "voxel_rows", "stray", "strength", "normals", "difference")
    rows = field.pop("voxel_rows")
    sound = ~field.pop("stray")[rows]
    found = {name: values[rows[sound]] for name, values in field.items()}
    after = store.read(tile, "normals", "normals", *(() if store.sensors is None else ("seen",)))
    found["oriented"] = after.pop("normals")[rows[sound]]
    return {
        "points": store.voxels(tile)[sound],
        **found,
        **{name: values[rows[sound]] for name, values in after.items()},
    }
