"""Clouds of any size: a coarse cage over everything, and tiles solved one by one with its potential.

The tiles' points lie in a folder on disk (`store`), from which whoever solves one (`engines`) reads its own
and the halo of its neighbours' (`solve`). Nothing but this folder is shared, so a tile can be solved
anywhere, and again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from face_plugin.tiles.choose import in_tiles

if TYPE_CHECKING:
    from face_plugin.tiles.run import estimate_tiled, solve_store

__all__ = ["estimate_tiled", "in_tiles", "solve_store"]


def __getattr__(name: str) -> Any:
    """Import what needs the solver on first use: the solver itself asks here whether to use tiles."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from face_plugin.tiles import run

    return getattr(run, name)
