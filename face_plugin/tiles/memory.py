"""How much memory there is, and how much a tile needs."""

from __future__ import annotations

import os
from pathlib import Path

from face_plugin.params import SMALLEST_TILE

__all__ = ["GIGABYTE", "PROCESS_BYTES", "available_memory", "fitting_tile_points", "tile_memory", "usable_cores"]

GIGABYTE = 1e9
# Measured (docs/scaling.md): an interpreter with this package and a coarse level loaded, a point of a tile or of its
# halo, and how much longer the halo makes the side of a tile, in spacings, where most sheets pass through it.
PROCESS_BYTES = 0.26e9
POINT_BYTES = 17.5e3
HALO_SIDE = 33.0

# Where the system does not tell.
ASSUMED_BYTES = 8e9
_CGROUP = Path("/sys/fs/cgroup")


def available_memory() -> float:
    """Bytes of memory that are free: of the machine, or of the container where that has less.

    Examples
    --------
    >>> available_memory() > 0
    True
    """
    return min(_machine_memory(Path("/proc/meminfo")), _container_memory(_CGROUP))


def _machine_memory(meminfo: Path) -> float:
    try:
        for line in meminfo.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return float(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return ASSUMED_BYTES


def _container_memory(folder: Path) -> float:
    try:
        limit = float((folder / "memory.max").read_text())  # "max" where there is none
        return limit - float((folder / "memory.current").read_text())
    except (OSError, ValueError):
        return float("inf")


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


def usable_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
