"""Checks in front of the meshers, and behind them.

Native meshers end the process, or hand back nonsense, on input that a look at the balls can tell: so no
mesher is called on balls that cannot be meshed in double precision, and no mesh goes on that does not fill
the box minus the balls.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import MeshingError
from face_plugin.faraday.balls import Balls
from face_plugin.faraday.domain import Box
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.meshers.boundary import ball_volumes, tet_volumes
from face_plugin.memory import GIGABYTE
from face_plugin.threads import KDTree

__all__ = ["check_balls", "check_memory", "check_mesh"]

# Mesh coordinates are of order one. Outside this range gmsh aborts the process: its predicates overflow.
BOX_SIDES = (1e-6, 1e6)
# Relative error of the volume of the mesh: a few rounding errors a tetrahedron.
VOLUME_TOLERANCE = 1e-6


def check_balls(
    balls: Balls, spacing: NDArray[np.float64], box: Box, *, smallest: float, gap: float, clearance: float
) -> None:
    """Raise unless the balls are finite, disjoint, large enough and inside the box.

    Parameters
    ----------
    balls : Balls
    spacing : (b,) float64
        Local spacing at each ball.
    box : Box
    smallest : float
        Smallest radius, relative to the longest side of the box.
    gap : float
        Smallest gap between two balls, relative to the distance of their centres.
    clearance : float
        Smallest distance between a ball's vertex and the box, relative to the longest side of the box.

    Raises
    ------
    MeshingError
        With what to try.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> from face_plugin.faraday.domain import padded_box
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> check_balls(balls, np.ones(3), padded_box(balls, 0.1), smallest=1e-10, gap=1e-9, clearance=1e-9)
    """
    side = box.upper - box.lower
    if not (np.isfinite(side).all() and side.min() > BOX_SIDES[0] and side.max() < BOX_SIDES[1]):
        raise MeshingError(
            f"the box must have sides within {BOX_SIDES}, found {side}; "
            "try Params.padding=0.1 and Params.least_side=0.25"
        )
    if not (np.isfinite(balls.vertices).all() and np.isfinite(spacing).all() and spacing.min() > 0):
        raise MeshingError("balls and spacings must be finite, and spacings positive")
    size = float(side.max())
    tiny = np.flatnonzero(balls.radii < smallest * size)
    if len(tiny):
        raise MeshingError(
            f"{len(tiny)} balls are too small to mesh, since points nearly coincide: a radius of "
            f"{balls.radii.min() / size:.1e} of the box, and at least {smallest:.0e} is needed; "
            "try Params.cage_spacing=None, or one above the distance of such points"
        )
    _check_disjoint(balls, gap)
    room = np.minimum(balls.vertices - box.lower, box.upper - balls.vertices).min() / size
    if room < clearance:
        raise MeshingError(
            f"a ball comes within {room:.1e} of the box (in its longest side), and at least {clearance:.0e} "
            "is needed; try a larger Params.padding"
        )


def _check_disjoint(balls: Balls, gap: float) -> None:
    if len(balls.radii) < 2:
        return
    tree = KDTree(balls.centres)
    nearest = tree.query(balls.centres, k=2)[0][:, 1]
    # Balls that all stay below half the way to their nearest neighbour are disjoint; only the others
    # need a search.
    wide = np.flatnonzero(balls.radii > 0.5 * (1 - gap) * nearest)
    for ball in wide:
        near = tree.query_ball_point(balls.centres[ball], 2 * balls.radii[ball] / (1 - gap))
        others = np.array([k for k in near if k != ball], dtype=np.intp)
        distance = np.linalg.norm(balls.centres[others] - balls.centres[ball], axis=1)
        if np.any(balls.radii[ball] + balls.radii[others] > (1 - gap) * distance):
            raise MeshingError(
                f"the ball at {balls.centres[ball]} touches another one; try a smaller Params.ball_radius"
            )


def check_memory(needed: float, allowed: float, what: str) -> None:
    """Raise when a step needs more bytes than are allowed.

    Examples
    --------
    >>> check_memory(1e8, 1e9, "the mesh of 1000 balls")
    """
    if needed > allowed:
        raise MeshingError(
            f"{what} takes about {needed / GIGABYTE:.2g} GB, more than the allowed {allowed / GIGABYTE:.2g}; "
            "try a larger Params.cage_spacing (fewer balls), Execution.tile_points, or Execution.max_memory"
        )


def check_mesh(mesh: CageMesh, balls: Balls, box: Box, *, advice: str) -> None:
    """Raise unless the tetrahedra are positive and fill the box minus the balls, and every vertex is used.

    Examples
    --------
    >>> from face_plugin import Params
    >>> from face_plugin.faraday.balls import build_balls
    >>> from face_plugin.faraday.domain import padded_box
    >>> from face_plugin.faraday.meshers.select import build_mesh
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> box = padded_box(balls, 0.1)
    >>> check_mesh(build_mesh(balls, np.ones(3), box, Params()), balls, box, advice="")
    """
    volume = tet_volumes(mesh.vertices, mesh.tets)
    expected = float(np.prod(box.upper - box.lower) - ball_volumes(balls).sum())
    if len(volume) == 0 or volume.min() <= 0:
        raise MeshingError(f"{int((volume <= 0).sum())} of {len(volume)} tetrahedra are flat or inverted; {advice}")
    if not np.isclose(volume.sum(), expected, rtol=VOLUME_TOLERANCE):
        share = volume.sum() / expected
        raise MeshingError(f"the tetrahedra fill {share:.6f} of the space between the box and the balls; {advice}")
    used = np.zeros(len(mesh.vertices), dtype=np.bool_)
    used[mesh.tets] = True
    unused = int(np.count_nonzero(~used))
    if unused:
        raise MeshingError(f"{unused} of {len(mesh.vertices)} vertices belong to no tetrahedron; {advice}")
    lost = len(balls.radii) - len(np.unique(mesh.owner[mesh.owner >= 0]))
    if lost:
        raise MeshingError(f"{lost} of {len(balls.radii)} balls were lost; {advice}")
