"""Which clouds are solved in tiles, how large these are, and who solves them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

from face_plugin.params import Params
from face_plugin.tiles.engines import Engine, Processes, Serial
from face_plugin.tiles.memory import (
    GIGABYTE,
    PROCESS_BYTES,
    available_memory,
    fitting_tile_points,
    tile_memory,
    usable_cores,
)

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["ONE_PIECE", "TILE_POINTS", "EngineLike", "in_tiles", "make_engine", "tile_size"]

EngineLike: TypeAlias = "str | Engine | Client | None"

ONE_PIECE = 100_000
"""Points up to which a cloud is solved in one piece unless `Params.tile_points` says otherwise."""
TILE_POINTS = 40_000
"""Points of a tile unless `Params.tile_points` says otherwise."""


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
