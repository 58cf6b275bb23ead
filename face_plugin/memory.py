"""How much memory there is, and how many cores."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["GIGABYTE", "available_memory", "usable_cores"]

GIGABYTE = 1e9
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


def usable_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
