"""The points that a tile is worked on with: its own, and a ring of its neighbours'."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin import cloud
from face_plugin.geometry import local_spacing, thin
from face_plugin.tiles.store import Store

__all__ = ["Surroundings", "surroundings"]

# Spacing that widths refer to, as a quantile over the tile: a few stray points must not widen the ring.
QUANTILE = 0.9
# The ring is thinned to this share of that spacing: beside a much denser tile it would outweigh the tile
# itself.
RING_SPACING = 0.5


@dataclass(frozen=True)
class Surroundings:
    """All distinct points in a box around a tile, in an order that depends on their positions alone."""

    points: NDArray[np.float64]
    """(n, 3) in the canonical frame; those of the ring no denser than half the tile's spacing."""
    own: NDArray[np.intp]
    """(k,) the row of `points` of each point that the tile owns."""
    tile: NDArray[np.int64]
    """(n,) the tile that owns each point."""
    row: NDArray[np.int64]
    """(n,) the row of each point in its tile."""
    spacing: float
    """Spacing of the tile's points."""
    lower: NDArray[np.float64]
    """(3,) corner of the box."""
    upper: NDArray[np.float64]
    """(3,) corner of the box."""


def surroundings(store: Store, tile: int, width: float) -> Surroundings:
    """Collect a tile and the ring around it.

    Parameters
    ----------
    store : Store
    tile : int
    width : float
        Of the ring, in the tile's spacings.
    """
    own = store.tile_points(tile)
    spacing = _spacing(own)
    while True:
        lower, upper = own.min(axis=0) - width * spacing, own.max(axis=0) + width * spacing
        subset = store.within(lower, upper)
        if np.ptp(subset.points, axis=0).max() > 0:
            order, leads = cloud.morton_distinct(subset.points)
            if np.count_nonzero(leads) >= cloud.MINIMUM_POINTS:
                break
        # Copies of one stray point, say: it needs neighbours, however far.
        spacing *= 4.0
    leader = order[leads]
    place = np.empty(len(order), dtype=np.intp)
    place[order] = np.cumsum(leads) - 1
    owned = np.flatnonzero(subset.tile == tile)
    rows = place[owned[np.argsort(subset.row[owned])]]
    separation = np.full(len(leader), RING_SPACING * spacing)
    separation[rows] = 0.0
    kept = thin(subset.points[leader], separation, store.params.seed)
    leader = leader[kept]
    return Surroundings(
        points=subset.points[leader],
        own=np.searchsorted(kept, rows),
        tile=subset.tile[leader],
        row=subset.row[leader],
        spacing=spacing,
        lower=lower,
        upper=upper,
    )


def _spacing(own: NDArray[np.float64]) -> float:
    distinct = np.unique(own, axis=0)
    if len(distinct) < 2:
        return cloud.MERGE_TOLERANCE
    return float(np.quantile(local_spacing(distinct), QUANTILE))
