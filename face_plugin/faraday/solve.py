"""One cage in one box: what a cloud in one piece, a large cloud's coarse cage and every tile solve alike."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import MeshingError
from face_plugin.faraday.balls import Balls, build_balls
from face_plugin.faraday.domain import Box, padded_box
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.meshers.select import build_mesh
from face_plugin.faraday.poisson import Poisson
from face_plugin.geometry import local_spacing
from face_plugin.params import Params
from face_plugin.stages import Stage

__all__ = ["SolvedCage", "solve_cage"]

log = logging.getLogger(__name__)

# Another seed turns and jitters everything anew: what made one mesh degenerate is then gone.
ATTEMPTS = 3
# A ball reaches at most this fraction of its way to a given box: beyond, it would cut through it.
BOX_REACH = 0.45


@dataclass(frozen=True)
class SolvedCage:
    """A cage, the mesh around it, and the potential in it."""

    balls: Balls
    mesh: CageMesh
    poisson: Poisson
    potential: NDArray[np.float64]
    """(m, d) at the vertices: column k is that of a unit field along canonical axis k."""

    @property
    def cage_value(self) -> NDArray[np.float64]:
        """Potential (d,) of the cage in each."""
        return np.asarray(self.potential[np.argmax(self.mesh.owner >= 0)])


def solve_cage(
    points: NDArray[np.float64],
    rows: NDArray[np.intp],
    params: Params,
    *,
    box: Box | None = None,
    given: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
    cage_value: NDArray[np.float64] | None = None,
    memory: float | None = None,
    stage: Stage = nullcontext,
) -> SolvedCage:
    """Build a cage on points and solve its basis potentials, one along each axis (paper sections 3.1 and 3.2).

    Parameters
    ----------
    points : (n, d) float64, distinct, in the canonical frame
        d is 3, or 2 in the plane.
    rows : (k,) intp
        Points that become balls.
    params : Params
    box : Box, optional
        By default that around the balls, padded as `params` says.
    given : callable, optional
        Potential (q, 3) at positions (q, 3) on the box; by default that of unit fields along the axes.
    cage_value : (3,) float64, optional
        Potential of the cage; by default it floats at zero net charge.
    memory : float, optional
        Bytes that meshing may take, by default all that are free.
    stage : callable, optional
        Entered for "domain", "mesh" and "poisson".

    Returns
    -------
    SolvedCage

    Raises
    ------
    MeshingError
        The space between the box and the balls could not be meshed, with several seeds.
    """
    for attempt in range(ATTEMPTS):
        try:
            another = dataclasses.replace(params, seed=params.seed + attempt)
            balls, mesh = _mesh(points, rows, another, box, memory, stage)
            break
        except MeshingError as error:
            if attempt == ATTEMPTS - 1:
                raise
            log.warning("%s; trying again with another seed", error)
    # Three basis fields: every other direction is their combination.
    with stage("poisson"):
        poisson = Poisson(mesh, params.solver)
        on_box = mesh.vertices[mesh.boundary]
        potential = poisson.solve(on_box if given is None else given(on_box), cage_value)
    return SolvedCage(balls, mesh, poisson, potential)


def _mesh(
    points: NDArray[np.float64],
    rows: NDArray[np.intp],
    params: Params,
    box: Box | None,
    memory: float | None,
    stage: Stage,
) -> tuple[Balls, CageMesh]:
    # The domain: a box without conducting balls.
    with stage("domain"):
        balls = build_balls(points, rows, radius=params.ball_radius, solid=params.solid, seed=params.seed)
        if box is not None:
            balls = _within(balls, box)
        else:
            box = padded_box(balls, params.padding, params.least_side)
        # Along a curve the two nearest are the neighbours.
        spacing = local_spacing(balls.centres, 2 if points.shape[1] == 2 else 6)
    # Tetrahedra between the box and the balls, graded from these to it.
    with stage("mesh"):
        return balls, build_mesh(balls, spacing, box, params, memory)


def _within(balls: Balls, box: Box) -> Balls:
    """Shrink the balls that would reach the box: an isolated point near it has a large one."""
    room = np.minimum(balls.centres - box.lower, box.upper - balls.centres).min(axis=1)
    radii = np.minimum(balls.radii, BOX_REACH * room)
    factor = (radii / balls.radii)[:, None, None]
    centres = balls.centres[:, None]
    return dataclasses.replace(balls, radii=radii, vertices=centres + factor * (balls.vertices - centres))
