"""Which clouds are solved in tiles, how large these are, and who solves them."""

from __future__ import annotations

from face_plugin.execution import SMALLEST_TILE, DaskClient, Engine, Execution, allowed_memory
from face_plugin.memory import GIGABYTE, usable_cores
from face_plugin.tiles.engines import Processes, Serial

__all__ = [
    "ONE_PIECE",
    "SHARE",
    "TILE_POINTS",
    "check_one_piece",
    "fitting_tile_points",
    "in_tiles",
    "make_engine",
    "tile_memory",
    "tile_size",
]

ONE_PIECE = 100_000
"""Points up to which a cloud is solved in one piece unless `Execution.tile_points` says otherwise."""
TILE_POINTS = 40_000
"""Points of a tile unless `Execution.tile_points` says otherwise."""
SHARE = 0.5
"""Share of the free memory that tiles take unless `Execution.max_memory` says otherwise: others need some as well."""


# Measured (docs/scaling.md): an interpreter with this package and a coarse cage loaded, a point of a tile or of its
# halo, and how much longer the halo makes the side of a tile, in spacings, where most sheets pass through it.
PROCESS_BYTES = 0.26e9
POINT_BYTES = 17.5e3
HALO_SIDE = 33.0


def in_tiles(count: int, execution: Execution) -> bool:
    """Whether a cloud of `count` points is solved in tiles.

    Examples
    --------
    >>> in_tiles(1_000_000, Execution()), in_tiles(5_000, Execution()), in_tiles(5_000, Execution(tile_points=2_000))
    (True, False, True)
    """
    if execution.tile_points is not None:
        return count > execution.tile_points
    return count > ONE_PIECE or tile_memory(count) > allowed_memory(execution.memory, SHARE)


def check_one_piece(count: int, execution: Execution, purpose: str) -> None:
    """Refuse to solve a cloud in one piece where the memory does not bear it.

    Parameters
    ----------
    count : int
        Points of the cloud.
    execution : Execution
    purpose : str
        What needs the cloud in one piece.

    Raises
    ------
    ValueError
        It takes more than `Execution.max_memory`, or than all that is free.
    """
    free = allowed_memory(execution.memory)
    needed = tile_memory(count)
    if needed > free:
        raise ValueError(
            f"points must be few enough for one piece, which {purpose} needs: {count} take about "
            f"{needed / GIGABYTE:.3g} GB, found {free / GIGABYTE:.3g} GB"
        )


def tile_size(count: int, execution: Execution) -> int:
    """Points aimed at for a tile: such that at least one fits into the memory.

    Raises
    ------
    ValueError
        `Execution.max_memory` is too little for any tile.
    """
    wanted = TILE_POINTS if execution.tile_points is None else execution.tile_points
    return fitting_tile_points(allowed_memory(execution.memory, SHARE), min(wanted, count))


def make_engine(execution: Execution, tile_points: int, count: int) -> Engine:
    """Return the engine that is asked for.

    Parameters
    ----------
    execution : Execution
    tile_points : int
        Points of a tile.
    count : int
        Points of the cloud.

    Raises
    ------
    MissingDependencyError
        Dask is asked for and is not installed.
    """
    chosen, memory = execution.engine, allowed_memory(execution.memory, SHARE)
    # This process holds no tile while others do, but it is there.
    fit = int((memory - PROCESS_BYTES) / tile_memory(tile_points))
    tiles = -(-count // tile_points)
    workers = max(1, min(execution.workers or usable_cores(), fit, tiles))
    if chosen == "auto":
        chosen = "processes" if workers > 1 else "serial"
    if chosen == "serial":
        return Serial()
    if chosen == "processes":
        # With a tile for each, to start one process more would take longer than what it saves.
        return Processes(workers, takes_part=tiles <= workers)
    # A client has the methods of an engine as well.
    if isinstance(chosen, (str, DaskClient)):
        from face_plugin.tiles.dask_engine import Dask

        return Dask(None if chosen == "dask" else chosen, workers, int(tile_memory(tile_points) * 2))
    return chosen


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
