"""Which clouds are solved in tiles, how large these are, and who solves them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

from face_plugin.memory import GIGABYTE, available_memory, usable_cores
from face_plugin.params import SMALLEST_TILE, Params
from face_plugin.tiles.engines import Engine, Processes, Serial

if TYPE_CHECKING:
    from distributed import Client

__all__ = [
    "ONE_PIECE",
    "TILE_POINTS",
    "EngineLike",
    "allowed_memory",
    "check_one_piece",
    "fitting_tile_points",
    "in_tiles",
    "make_engine",
    "tile_memory",
    "tile_size",
]

EngineLike: TypeAlias = "str | Engine | Client | None"

ONE_PIECE = 100_000
"""Points up to which a cloud is solved in one piece unless `Params.tile_points` says otherwise."""
TILE_POINTS = 40_000
"""Points of a tile unless `Params.tile_points` says otherwise."""


# Measured (docs/scaling.md): an interpreter with this package and a coarse level loaded, a point of a tile or of its
# halo, and how much longer the halo makes the side of a tile, in spacings, where most sheets pass through it.
PROCESS_BYTES = 0.26e9
POINT_BYTES = 17.5e3
HALO_SIDE = 33.0


def allowed_memory(params: Params) -> float:
    """Bytes that all processes together may take, half of what is free unless `params` says otherwise."""
    return 0.5 * available_memory() if params.max_memory is None else params.max_memory * GIGABYTE


def in_tiles(count: int, params: Params) -> bool:
    """Whether a cloud of `count` points is solved in tiles.

    Examples
    --------
    >>> in_tiles(1_000_000, Params()), in_tiles(5_000, Params()), in_tiles(5_000, Params(tile_points=2_000))
    (True, False, True)
    """
    if params.tile_points is not None:
        return count > params.tile_points
    return count > ONE_PIECE or tile_memory(count) > allowed_memory(params)


def check_one_piece(count: int, params: Params, purpose: str) -> None:
    """Refuse to solve a cloud in one piece where the memory does not bear it.

    Parameters
    ----------
    count : int
        Points of the cloud.
    params : Params
    purpose : str
        What needs the cloud in one piece.

    Raises
    ------
    ValueError
        It takes more than `Params.max_memory`, or than all that is free.
    """
    free = available_memory() if params.max_memory is None else params.max_memory * GIGABYTE
    needed = tile_memory(count)
    if needed > free:
        raise ValueError(
            f"points must be few enough for one piece, which {purpose} needs: {count} take about "
            f"{needed / GIGABYTE:.3g} GB, found {free / GIGABYTE:.3g} GB"
        )


def tile_size(count: int, params: Params) -> int:
    """Points aimed at for a tile: such that at least one fits into the memory.

    Raises
    ------
    ValueError
        `Params.max_memory` is too little for any tile.
    """
    wanted = TILE_POINTS if params.tile_points is None else params.tile_points
    return fitting_tile_points(allowed_memory(params), min(wanted, count))


def make_engine(engine: EngineLike, params: Params, tile_points: int, count: int) -> Engine:
    """Return the engine that `engine`, or else `params`, asks for.

    Parameters
    ----------
    engine : str, Engine or distributed.Client, optional
        "auto", "serial", "processes", "dask", the address of a Dask scheduler, a client of one, or an object
        with the methods of `Engine`.
    params : Params
    tile_points : int
        Points of a tile.
    count : int
        Points of the cloud.

    Raises
    ------
    ValueError
        It is none of these.
    MissingDependencyError
        Dask is asked for and is not installed.
    """
    chosen: Any = params.engine if engine is None else engine
    memory = allowed_memory(params)
    # This process holds no tile while others do, but it is there.
    fit = int((memory - PROCESS_BYTES) / tile_memory(tile_points))
    tiles = -(-count // tile_points)
    workers = max(1, min(params.workers or usable_cores(), fit, tiles))
    if chosen == "auto":
        chosen = "processes" if workers > 1 else "serial"
    if chosen == "serial":
        return Serial()
    if chosen == "processes":
        # With a tile for each, to start one process more would take longer than what it saves.
        return Processes(workers, takes_part=tiles <= workers)
    if isinstance(chosen, str) and chosen != "dask" and "://" not in chosen:
        raise ValueError(
            "engine must be 'auto', 'serial', 'processes', 'dask' or an address such as 'tcp://host:8786', "
            f"found {chosen!r}"
        )
    if isinstance(chosen, str) or hasattr(chosen, "scheduler_info"):
        from face_plugin.tiles.dask_engine import Dask

        return Dask(None if chosen == "dask" else chosen, workers, int(tile_memory(tile_points) * 2))
    if not all(hasattr(chosen, name) for name in ("__enter__", "__exit__", "run")):
        raise ValueError(f"engine must be a name, an address, a Client or an Engine, found {chosen!r}")
    own: Engine = chosen
    return own


def tile_memory(points: float) -> float:
    """Bytes that a process needs for a tile of so many points: the smaller it is, the more of it is halo.

    Examples
    --------
    >>> 1.1 < tile_memory(40_000) / 1e9 < 1.3
    True
    """
    return float(PROCESS_BYTES + POINT_BYTES * (points**0.5 + HALO_SIDE) ** 2)


def fitting_tile_points(memory: float, wanted: int) -> int:
    """Points of a tile that fit in so many bytes, at most `wanted`.

    Raises
    ------
    ValueError
        Not even the smallest tile fits.

    Examples
    --------
    >>> fitting_tile_points(8e9, 20_000)
    20000
    """
    side = (max(memory - PROCESS_BYTES, 0.0) / POINT_BYTES) ** 0.5 - HALO_SIDE
    points = int(max(side, 0.0) ** 2)
    if points < SMALLEST_TILE:
        least = tile_memory(SMALLEST_TILE) / GIGABYTE
        raise ValueError(f"max_memory must be at least {least:.2f} GB, found {memory / GIGABYTE:.2f}")
    return min(points, wanted)
