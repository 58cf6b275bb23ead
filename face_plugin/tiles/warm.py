"""Load the compiled code of a tile's two stages into a process before its first tile."""

from __future__ import annotations

import numpy as np

from face_plugin.faraday import field, gradient
from face_plugin.faraday.locate import Locator
from face_plugin.faraday.solve import solve_level
from face_plugin.geometry import unit
from face_plugin.params import Params
from face_plugin.refine import refine
from face_plugin.sides.confidence import confidence
from face_plugin.sides.sheets import cage_separation
from face_plugin.tiles.solve import one_thread

__all__ = ["warm_up"]

# Enough for every neighbourhood that the stages look at.
POINTS = 100


def warm_up() -> None:
    """Take a small cloud through both stages: libraries and compiled code are then in memory."""
    ball = unit(np.random.default_rng(0).normal(size=(POINTS, 3)))
    with one_thread():
        level = solve_level(ball, cage_separation(ball, None)[0], Params())
        Locator(level.mesh).interpolate(ball, level.potential)
        strength = field.strength(level.mesh, level.potential, "exact")
        gradient.field_normals(level.mesh, strength)
        confidence(ball, ball, refine(ball, ball, np.ones(POINTS)))
