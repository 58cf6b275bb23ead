"""One cage in one box: what the whole cloud's coarse level and every tile solve alike."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import MeshingError
from face_plugin.faraday import domain
from face_plugin.faraday.balls import Balls, build_balls
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.meshers.select import build_mesh
from face_plugin.faraday.poisson import Poisson
from face_plugin.geometry import local_spacing, thin
from face_plugin.params import Params

__all__ = ["Level", "solve_level"]

log = logging.getLogger(__name__)

Clock = Callable[[str], None]
"""Called with the name of a stage when it ends."""

# Another seed turns and jitters everything anew: what made one mesh degenerate is then gone.
ATTEMPTS = 3
# A ball reaches at most this far of its way to the box: beyond, it would cut through it.
REACH = 0.45


@dataclass(frozen=True)
class Level:
    """A solved cage."""

    balls: Balls
    mesh: CageMesh
    potential: NDArray[np.float64]
    """(m, 3) potential at the vertices in a unit field along each canonical axis."""
    cage_value: NDArray[np.float64]
    """(3,) potential of the cage in each."""


def solve_level(
    points: NDArray[np.float64],
    separation: NDArray[np.float64],
    params: Params,
    *,
    box: domain.Box | None = None,
    given: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
    cage_value: NDArray[np.float64] | None = None,
    clock: Clock = lambda stage: None,
) -> Level:
    """Build a cage on points and solve its three basis potentials.

    Parameters
    ----------
    points : (n, 3) float64, distinct, in the canonical frame
    separation : (n,) float64
        Smallest distance between balls at each point.
    params : Params
    box : Box, optional
        By default that around the balls, padded as `params` says.
    given : callable, optional
        Potential (q, 3) at positions (q, 3) on the box; by default that of unit fields along the axes.
    cage_value : (3,) float64, optional
        Potential of the cage; by default it floats at zero net charge.
    clock : callable, optional

    Returns
    -------
    Level

    Raises
    ------
    MeshingError
        The space between the box and the balls could not be meshed, with several seeds.
    """
    for attempt in range(ATTEMPTS):
        try:
            balls, mesh = _mesh(points, separation, params, box, params.seed + attempt, clock)
            break
        except MeshingError as error:
            if attempt == ATTEMPTS - 1:
                raise
            log.warning("%s; trying again with another seed", error)
    poisson = Poisson(mesh, params.solver)
    on_box = mesh.vertices[mesh.boundary]
    potential = poisson.solve(on_box if given is None else given(on_box), cage_value)
    clock("poisson")
    return Level(balls, mesh, potential, potential[np.argmax(mesh.owner >= 0)])


def _mesh(
    points: NDArray[np.float64],
    separation: NDArray[np.float64],
    params: Params,
    box: domain.Box | None,
    seed: int,
    clock: Clock,
) -> tuple[Balls, CageMesh]:
    rows = thin(points, separation, seed)
    balls = build_balls(points, rows, radius=params.ball_radius, solid=params.solid, seed=seed)
    if box is not None:
        balls = _within(balls, box)
    clock("cage")
    if box is None:
        box = domain.padded_box(balls, params.padding, params.least_side)
    spacing = local_spacing(balls.centres)
    mesh = build_mesh(balls, spacing, box, dataclasses.replace(params, seed=seed))
    clock("mesh")
    return balls, mesh


def _within(balls: Balls, box: domain.Box) -> Balls:
    """Shrink the balls that would reach the box: an isolated point near it has a large one."""
    room = np.minimum(balls.centres - box.lower, box.upper - balls.centres).min(axis=1)
    radii = np.minimum(balls.radii, REACH * room)
    factor = (radii / balls.radii)[:, None, None]
    centres = balls.centres[:, None]
    return dataclasses.replace(balls, radii=radii, vertices=centres + factor * (balls.vertices - centres))
