"""One tile: its cage, the coarse potential on its box, and what follows for the points it owns."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from threadpoolctl import threadpool_limits

from face_plugin import cage, cloud, field, normals
from face_plugin.domain import Box
from face_plugin.tiles.coarse import Coarse
from face_plugin.tiles.level import solve_level
from face_plugin.tiles.store import Store

__all__ = ["HALO", "TILE_STAGES", "TileCage", "solve_tile", "tile_cage"]

log = logging.getLogger(__name__)

# Width of the ring of neighbours' points around a tile, in local spacings: behind so many balls the field no
# longer depends on the boundary data.
HALO = 8.0
# The spacing that this refers to, as a quantile over the tile's points: a few stray points must not widen
# it.
HALO_QUANTILE = 0.9
# The ring is thinned to this share of that spacing: beside a much denser tile it would outweigh the tile
# itself.
HALO_THINNING = 0.5
TILE_STAGES = ("cage", "mesh", "poisson", "field", "normals", "interior")

# A tile takes a core and its share of the memory; gmsh is one per process anyway.
_one_at_a_time = threading.Lock()


@dataclass(frozen=True)
class TileCage:
    """Where a tile's cage is to stand."""

    points: NDArray[np.float64]
    """(n, 3) distinct points of the tile and its halo: all in the box, so that the cage has no hole."""
    own: NDArray[np.intp]
    """(k,) the row of `points` of each point that the tile owns."""
    separation: NDArray[np.float64]
    """(n,) smallest distance between balls: on the tile as in one piece, in the halo no finer than there."""
    box: Box


@lru_cache(maxsize=1)
def _coarse(folder: Path, key: str) -> Coarse:
    return Coarse.load(folder)


def solve_tile(folder: str, tile: int) -> int:
    """Solve one tile of a store and write what it says of its points.

    The outcome depends on the store and on the number of the tile alone, to the last bit: not on the
    process, nor on how many threads its libraries would use.

    Parameters
    ----------
    folder : str
        Of the store.
    tile : int

    Returns
    -------
    int
        The tile's number.

    Raises
    ------
    MeshingError
        The tile could not be meshed.
    """
    store = Store.load(Path(folder))
    if not store.done(tile, "field"):
        with _one_at_a_time, threadpool_limits(1):
            store.write(tile, "field", **_solve(store, tile))
    return tile


def _solve(store: Store, tile: int) -> dict[str, NDArray[np.generic]]:
    params = store.params
    seconds = dict.fromkeys(TILE_STAGES, 0.0)
    last = time.perf_counter()

    def clock(stage: str) -> None:
        nonlocal last
        now = time.perf_counter()
        seconds[stage] += now - last
        last = now

    coarse = _coarse(store.folder, store.key)
    part = tile_cage(store, tile)
    clock("cage")
    level = solve_level(
        part.points,
        part.separation,
        params,
        box=part.box,
        given=coarse.at,
        cage_value=coarse.cage_value,
        clock=clock,
    )
    own = part.points[part.own]
    strength = field.strength(level.mesh, level.potential, params.directions)
    at_balls = normals.ball_means(level.mesh, strength)
    ball = cKDTree(level.balls.centres).query(own)[1]
    clock("field")
    field_normals = normals.field_normals(level.mesh, strength)
    carried = normals.carry(level.balls.centres, field_normals, own)
    clock("normals")
    return {
        "normals": carried,
        "strength": at_balls[ball],
        "confidence": np.ones(len(own)),
        "seconds": np.array([seconds[stage] for stage in TILE_STAGES]),
        "balls": np.array([len(level.balls.radii), len(level.mesh.vertices)]),
    }


def tile_cage(store: Store, tile: int, halo: float = HALO) -> TileCage:
    """Collect the points that a tile is solved with, and their cage's separations.

    Parameters
    ----------
    store : Store
    tile : int
    halo : float
        Width of the ring of neighbours' points around the tile's own, in local spacings.
    """
    own = store.tile_points(tile)
    spacing = _spacing(own)
    while True:
        reach = halo * spacing
        lower, upper = own.min(axis=0) - reach, own.max(axis=0) + reach
        subset = store.within(lower, upper)
        if np.ptp(subset.points, axis=0).max() > 0:
            # The order of the points is that of their positions, whichever way the input was sorted.
            order, first = cloud.morton_distinct(subset.points)
            if np.count_nonzero(first) >= cloud.MINIMUM_POINTS:
                break
        # Copies of one stray point, say: it needs neighbours, however far.
        spacing *= 4.0
    points = subset.points[order[first]]
    of_point = np.empty(len(order), dtype=np.intp)
    of_point[order] = np.cumsum(first) - 1
    owned = np.flatnonzero(subset.tile == tile)
    rows = of_point[owned[np.argsort(subset.row[owned])]]
    given = store.params.cage_spacing
    separation = cage.separation(points, None if given is None else given / store.frame.scale)
    ring = np.ones(len(points), dtype=np.bool_)
    ring[rows] = False
    separation[ring] = np.maximum(separation[ring], HALO_THINNING * spacing)
    # The box keeps clear of the last balls.
    return TileCage(points, rows, separation, Box(lower - spacing, upper + spacing))


def _spacing(own: NDArray[np.float64]) -> float:
    """Spacing of a tile's points that counts for its halo."""
    distinct = np.unique(own, axis=0)
    if len(distinct) < 2:
        return cloud.MERGE_TOLERANCE
    return float(np.quantile(cage.local_spacing(distinct), HALO_QUANTILE))
