"""One tile: its cage, the coarse potential on its box, and what follows for the points it owns."""

from __future__ import annotations

import logging
import threading
import time
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

__all__ = ["HALO", "TILE_STAGES", "solve_tile"]

log = logging.getLogger(__name__)

# Width of the ring of neighbours' points around a tile, in local spacings: behind so many balls the field no
# longer depends on the boundary data.
HALO = 8.0
# The spacing that this refers to, as a quantile over the tile's points: a few stray points must not widen it.
HALO_QUANTILE = 0.9
# The ring is thinned to this share of that spacing: beside a much denser tile it would outweigh the tile
# itself.
HALO_THINNING = 0.5
TILE_STAGES = ("cage", "domain", "mesh", "poisson", "field", "normals", "interior")

# A tile takes a core and its share of the memory; gmsh is one per process anyway.
_one_at_a_time = threading.Lock()


@lru_cache(maxsize=1)
def _coarse(folder: Path, key: str) -> Coarse:
    return Coarse.load(folder)


def solve_tile(folder: str, tile: int) -> int:
    """Solve one tile of a store and write what it says of its points.

    The outcome depends on the store and on the number of the tile alone, to the last bit: not on the process,
    nor on how many threads its libraries would use.

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

    own = store.tile_points(tile)
    # 1. The tile's points and its halo: everything inside its box, so that no hole opens in the cage.
    coarse = _coarse(store.folder, store.key)
    spacing = _spacing(own)
    box = Box(own.min(axis=0) - HALO * spacing, own.max(axis=0) + HALO * spacing)
    subset = store.within(box.lower, box.upper)
    # The order of the points is that of their positions, whichever way the input was sorted.
    order, first = cloud.morton_distinct(subset.points)
    points = subset.points[order[first]]
    of_point = np.empty(len(order), dtype=np.intp)
    of_point[order] = np.cumsum(first) - 1
    owned = np.flatnonzero(subset.tile == tile)
    rows = of_point[owned[np.argsort(subset.row[owned])]]
    separation = _separation(points, rows, spacing, store)
    # 2. The same problem as in one piece, with the coarse potential around it. The box keeps clear of the
    # last balls.
    room = Box(box.lower - spacing, box.upper + spacing)
    level = solve_level(
        points, separation, params, box=room, given=coarse.at, cage_value=coarse.cage_value, clock=clock
    )
    # 3. What it says of the tile's own points.
    strength = field.strength(level.mesh, level.potential, params.directions)
    at_balls = normals.ball_means(level.mesh, strength)
    ball = cKDTree(level.balls.centres).query(points[rows])[1]
    clock("field")
    field_normals = normals.field_normals(level.mesh, strength)
    carried = normals.carry(level.balls.centres, field_normals, points[rows])
    clock("normals")
    return {
        "normals": carried,
        "strength": at_balls[ball],
        "seconds": np.array([seconds[stage] for stage in TILE_STAGES]),
        "balls": np.array([len(level.balls.radii), len(level.mesh.vertices)]),
    }


def _spacing(own: NDArray[np.float64]) -> float:
    """Spacing of a tile's points that counts for its halo."""
    distinct = np.unique(own, axis=0)
    if len(distinct) < 2:
        return float(cloud.MERGE_TOLERANCE)
    return float(np.quantile(cage.local_spacing(distinct), HALO_QUANTILE))


def _separation(
    points: NDArray[np.float64], own: NDArray[np.intp], spacing: float, store: Store
) -> NDArray[np.float64]:
    """Smallest distance between balls: on the tile as in one piece, in the halo no finer than on the tile."""
    given = store.params.cage_spacing
    separation = cage.separation(points, None if given is None else given / store.frame.scale)
    halo = np.ones(len(points), dtype=np.bool_)
    halo[own] = False
    separation[halo] = np.maximum(separation[halo], HALO_THINNING * spacing)
    return separation
