"""One tile: its cage, the coarse potential on its box, and what follows for the points it owns.

Two stages: what the field says, and, when all tiles have that, what the oriented points say together. The steps are
those of a cloud in one piece (`face_plugin.method`).
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from face_plugin.errors import MissingDependencyError, require
from face_plugin.faraday.domain import Box
from face_plugin.faraday.gradient import field_at_points
from face_plugin.faraday.locate import Locator
from face_plugin.geometry import local_spacing, unit
from face_plugin.method import orient, solve_field
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.params import Params
from face_plugin.sides.confidence import confidence, witness
from face_plugin.sides.enclosure import enclosed
from face_plugin.sides.patches import planes_of
from face_plugin.sides.sheets import find_sheets
from face_plugin.sides.sights import sights
from face_plugin.sides.strays import find_strays
from face_plugin.stages import Clock
from face_plugin.threads import KDTree
from face_plugin.tiles.coarse import Coarse
from face_plugin.tiles.scene import scene
from face_plugin.tiles.stations import as_scanned
from face_plugin.tiles.store import Store
from face_plugin.tiles.surroundings import Surroundings, surroundings

__all__ = ["HALO", "ORIENT_STAGES", "TILE_STAGES", "one_thread", "orient_tile", "solve_tile", "warm_up"]

# Width of the ring of neighbours' points around a tile, in local spacings: behind so many balls the field no
# longer depends on the boundary data.
HALO = 6.0
# The smallest cell of free vertices that is aimed at, as a share of the largest that `Params.finest` allows,
# and the numbers of cells along the box that are tried for it: with them some power of two is never far.
FINEST_CELL = 0.65
CELLS = (4, 5, 6, 7)
TILE_STAGES = ("cage", "domain", "mesh", "poisson", "field", "normals")
ORIENT_STAGES = ("scene", "refine", "enclosure", "confidence")
# Points of the cloud that warms a process up: enough for every neighbourhood that the stages look at.
WARM_POINTS = 100

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
    params, clock = store.params, Clock(now=time.process_time)
    with clock("cage"):
        coarse = _coarse(store.folder, store.key)
        part = surroundings(store, tile, HALO)
        own = part.points[part.own]
        around = Neighbourhood(part.points)
        stray = find_strays(around)
        if stray.any():
            around = Neighbourhood(part.points[~stray])
        place = np.maximum(np.cumsum(~stray) - 1, 0)[part.own]
        scanned = as_scanned(store, tile, around, place, stray[part.own]) if store.refines else {}
    solved = solve_field(
        around,
        params,
        store.frame.scale,
        box=_box(part, params),
        given=coarse.at,
        cage_value=coarse.cage_value,
        memory=store.memory,
        stage=clock,
    )
    found: dict[str, NDArray[np.generic]] = {}
    with clock("field"):
        if store.refines:
            # The second stage needs them as well, and to look for them is a fifth of all work.
            sheets = solved.sheets or find_sheets(around)
            found = {name: values[place] for name, values in vars(sheets).items()}
        if store.interior:
            # Inside an isosurface is where the field is below its value, in the tile's box as everywhere.
            found["e_max"] = Locator(solved.cage.mesh).interpolate(own, solved.strength)
    with clock("normals"):
        seen = field_at_points(solved.cage.mesh, solved.strength, solved.cage.balls, own)
        voxels = KDTree(own).query(store.voxels(tile))[1]
    return {
        **found,
        **scanned,
        # Strays are in no field: they have no vote.
        "strength": np.where(stray[part.own], 0.0, seen.strength),
        "stray": stray[part.own],
        "normals": seen.normals,
        "difference": seen.difference,
        "voxel_rows": voxels,
        "seconds": _seconds(clock, TILE_STAGES),
        "balls": np.array([len(solved.cage.balls.radii), len(solved.cage.mesh.vertices)]),
    }


def orient_tile(folder: str, tile: int) -> int:
    """Orient the normals of one tile of a store, and tell how far they can be trusted and what is enclosed.

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
            store.write(tile, "normals", **_orient(store, tile))
    return tile


def _orient(store: Store, tile: int) -> dict[str, NDArray[np.generic]]:
    clock = Clock(now=time.process_time)
    with clock("scene"):
        seen = scene(store, tile)
        around = Neighbourhood(seen.points)
    with clock("refine"):
        seen_by = planes = None
        if store.sensors is not None:
            planes = planes_of(around)
            seen_by = sights(around, store.sensors.about(seen.points[seen.own]), planes.lines, seen.near)
        normals = orient(
            around, seen.field, store.params,
            plane=store.plane, sheets=seen.sheets, moving=seen.near, sights=seen_by, planes=planes,
        )  # fmt: skip
        own, stray = seen.own, seen.stray[seen.own]
        # A stray is given the normal of the nearest point that is none.
        sound = np.flatnonzero(~seen.stray)
        like = own.copy()
        like[stray] = sound[KDTree(seen.points[sound]).query(seen.points[own[stray]])[1]]
    found: dict[str, NDArray[np.generic]] = {"normals": normals[like]}
    if seen_by is not None:
        found["seen"] = np.asarray(seen_by.any(axis=1))[own]
    with clock("enclosure"):
        if store.interior:
            inside = enclosed(around, normals, seen.field.strength, seen.near)
            if seen_by is not None:
                # What a sensor saw does not lie inside anything.
                inside &= ~seen_by.any(axis=1)
            found["enclosed"] = inside[own] & ~stray
    with clock("confidence"):
        witnessed = witness(seen.field.votes, seen_by)
        found["confidence"] = np.where(stray, 0.0, confidence(around, witnessed, normals, own))
    return {**found, "seconds": _seconds(clock, ORIENT_STAGES)}


def _seconds(clock: Clock, stages: Sequence[str]) -> NDArray[np.float64]:
    return np.array([clock.seconds.get(stage, 0.0) for stage in stages])


def warm_up() -> None:
    """Take a small cloud through both stages: libraries and compiled code are then in memory."""
    ball = unit(np.random.default_rng(0).normal(size=(WARM_POINTS, 3)))
    with one_thread():
        around, params = Neighbourhood(ball), Params()
        solved = solve_field(around, params, 1.0)
        Locator(solved.cage.mesh).interpolate(ball, solved.strength)
        seen = field_at_points(solved.cage.mesh, solved.strength, solved.cage.balls, ball)
        confidence(around, seen.votes, orient(around, seen, params, sheets=solved.sheets))


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
