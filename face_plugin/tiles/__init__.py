"""Clouds of any size: a coarse cage over everything, and tiles solved one by one with its potential.

The tiles' points lie in a folder on disk (`store`), from which whoever solves one (`engines`) reads its own
and the halo of its neighbours' (`tile`). Nothing but this folder is shared, so a tile can be solved
anywhere, and again.
"""

from face_plugin.tiles.plan import in_tiles
from face_plugin.tiles.run import estimate_tiled, solve_store
from face_plugin.tiles.tiled import Tiled

__all__ = ["Tiled", "estimate_tiled", "in_tiles", "solve_store"]
