"""One tile: its cage, the coarse potential on its box, and what follows for the points it owns."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from threadpoolctl import threadpool_limits

from face_plugin.errors import MissingDependencyError, require
from face_plugin.faraday import field, gradient
from face_plugin.faraday.domain import Box
from face_plugin.faraday.locate import Locator
from face_plugin.faraday.solve import solve_level
from face_plugin.geometry import local_spacing, neighbourhoods
from face_plugin.params import Params
from face_plugin.sides.sheets import cage_separation, find_sheets
from face_plugin.tiles.coarse import Coarse
from face_plugin.tiles.store import Store
from face_plugin.tiles.surroundings import Surroundings, surroundings

__all__ = ["HALO", "TILE_STAGES", "one_thread", "solve_tile"]

log = logging.getLogger(__name__)

# Width of the ring of neighbours' points around a tile, in local spacings: behind so many balls the field no
# longer depends on the boundary data.
HALO = 6.0
# The smallest cell of free vertices that is aimed at, as a share of the largest that `Params.finest` allows,
# and the numbers of cells along the box that are tried for it: with them some power of two is never far.
FINEST_CELL = 0.65
CELLS = (4, 5, 6, 7)
TILE_STAGES = ("cage", "mesh", "poisson", "field", "normals")

# A tile takes a core and its share of the memory; gmsh is one per process anyway.
_one_at_a_time = threading.Lock()


@contextmanager
def one_thread() -> Iterator[None]:
    """Run what follows alone in this process, and its libraries on one thread: sums then have one order."""
    _load_solver()
    with _one_at_a_time, threadpool_limits(1):
        yield


@lru_cache(maxsize=1)
def _load_solver() -> None:
    """Load the solver's BLAS: only what is loaded can be told how many threads to use."""
    with suppress(MissingDependencyError):
        require("sksparse.cholmod", extra="cholmod")


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
        with one_thread():
            store.write(tile, "field", **_solve(store, tile))
    return tile


def _solve(store: Store, tile: int) -> dict[str, NDArray[np.generic]]:
    params = store.params
    seconds = dict.fromkeys(TILE_STAGES, 0.0)
    last = time.process_time()

    def clock(stage: str) -> None:
        nonlocal last
        now = time.process_time()
        seconds[stage] += now - last
        last = now

    coarse = _coarse(store.folder, store.key)
    part = surroundings(store, tile, HALO)
    given = params.cage_spacing
    spacing = None if given is None else given / store.frame.scale
    separation, sheets = cage_separation(part.points, spacing, coarsen=params.angles == "refined")
    if store.refines:
        sheets = sheets or find_sheets(part.points, *neighbourhoods(part.points))
    clock("cage")
    level = solve_level(
        part.points,
        separation,
        params,
        box=_box(part, params),
        given=coarse.at,
        cage_value=coarse.cage_value,
        clock=clock,
    )
    own = part.points[part.own]
    strength = field.strength(level.mesh, level.potential, params.directions)
    at_balls = gradient.ball_means(level.mesh, strength)
    ball = cKDTree(level.balls.centres).query(own)[1]
    found = {"strength": at_balls[ball]}
    if store.refines and sheets is not None:
        # The second stage needs them as well, and to look for them is a fifth of all work.
        found |= {name: values[part.own] for name, values in vars(sheets).items()}
    if store.interior:
        # Inside the isosurface of a level is where the field is below it, in the tile's box as everywhere.
        found["level"] = Locator(level.mesh).interpolate(own, strength)
    clock("field")
    field_normals = gradient.field_normals(level.mesh, strength)
    carried = gradient.carry(level.balls.centres, field_normals, own)
    voxels = cKDTree(own).query(store.voxels(tile))[1]
    clock("normals")
    return {
        **found,
        "normals": carried,
        "voxel_rows": voxels,
        "seconds": np.array([seconds[stage] for stage in TILE_STAGES]),
        "balls": np.array([len(level.balls.radii), len(level.mesh.vertices)]),
    }


def _box(part: Surroundings, params: Params) -> Box:
    """Box of a tile, clear of the last balls, cut so that its smallest cells suit the spacing.

    Halving a given size meets the one that is wanted within a factor of two only: too large, and sheets near one
    another are not told apart; different from tile to tile, and so is the strength.
    """
    lower, upper = part.lower - part.spacing, part.upper + part.spacing
    side = upper - lower
    wanted = FINEST_CELL * params.finest * float(np.median(local_spacing(part.points)))

    def misses(cells: int) -> float:
        size = float((side / np.maximum(np.round(side / (side.max() / cells)), 1)).max())
        octaves = np.log2(size / wanted)
        return float(abs(octaves - np.round(octaves)))

    return Box(lower, upper, min(CELLS, key=misses))
