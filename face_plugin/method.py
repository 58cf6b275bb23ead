"""The method, step by step: what is done to a cloud in one piece, and to each tile of a larger one.

    points -> cage -> mesh -> field -> votes -> sides -> angles -> interior, confidence

Each step is a call into one room: `faraday` is the paper, `sides` tells on which side of a point free space is, and
`angles` tells the line of its normal. Sections are those of the paper.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.angles.borders import bend_borders
from face_plugin.angles.levelling import level, level_weight
from face_plugin.angles.turning import turn_angles
from face_plugin.faraday import field
from face_plugin.faraday.domain import Box
from face_plugin.faraday.gradient import FieldAtPoints
from face_plugin.faraday.solve import SolvedCage, solve_cage
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.params import Params
from face_plugin.sides.sheets import Sheets, back_to_back, cage_separation, find_sheets
from face_plugin.sides.steps import turn_sides
from face_plugin.stages import Stage

__all__ = ["Solved", "orient", "refine", "solve_field"]


@dataclass(frozen=True)
class Solved:
    """What is known before any normal is."""

    cage: SolvedCage
    strength: NDArray[np.float64]
    """(m,) E_max at the vertices of the mesh."""
    sheets: Sheets | None
    """Of the points, where they were looked for."""


def solve_field(
    around: Neighbourhood,
    params: Params,
    scale: float,
    *,
    box: Box | None = None,
    given: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
    cage_value: NDArray[np.float64] | None = None,
    stage: Stage = nullcontext,
) -> Solved:
    """From points to the field around them.

    Parameters
    ----------
    around : Neighbourhood
        Of the points, in the canonical frame.
    params : Params
    scale : float
        Length of the canonical frame's unit in that of the input.
    box, given, cage_value, stage
        As of `face_plugin.faraday.solve.solve_cage`; the stage "field" follows.
    """
    # Where balls go: near-duplicates are left out, and points on sheets with nothing else near.
    with stage("cage"):
        spacing = None if params.cage_spacing is None else params.cage_spacing / scale
        separation, sheets = cage_separation(around, spacing, coarsen=params.angles == "refined")
    points = around.points
    # The neighbours take a tenth of the memory of what follows: who needs them no more need not hold them.
    del around
    # Balls (3.1), the box around them, the mesh between, and the potential of three basis fields (3.2).
    cage = solve_cage(points, separation, params, box=box, given=given, cage_value=cage_value, stage=stage)
    # The greatest strength that an external field of any direction causes (3.3).
    with stage("field"):
        strength = field.strength(cage.mesh, cage.potential, params.directions)
    return Solved(cage, strength, sheets)


def orient(
    around: Neighbourhood,
    seen: FieldAtPoints,
    params: Params,
    *,
    plane: NDArray[np.float64] | None = None,
    sheets: Sheets | None = None,
    moving: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """From the field at the points to their normals.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    seen : FieldAtPoints
    params : Params
    plane : (3,) float64, optional
        Unit normal of the plane that all points lie in.
    sheets, moving
        As of `refine`.

    Returns
    -------
    (n, 3) float64
        Outward unit normals.
    """
    if plane is not None:
        # The field is the same on both sides of a sheet: its mean gradient lies in the sheet.
        return np.tile(plane, (len(around), 1))
    if params.angles == "field":
        # The strength grows outward, so its gradient at a ball points outward (3.4).
        return seen.normals
    return refine(around, seen.votes, seen.strength, sheets, moving)


def refine(
    around: Neighbourhood,
    votes: NDArray[np.float64],
    strength: NDArray[np.float64],
    sheets: Sheets | None = None,
    moving: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Refine rough outward normals by the points themselves: first their side, then their angle.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    votes : (n, 3) float64
        Rough outward unit normals, most of them on the right side; zero where nothing is known.
    strength : (n,) float64
        E_max at the points.
    sheets : Sheets, optional
        Of the points, where they are known already; those of points that do not move are not looked at.
    moving : (n,) bool, optional
        Which normals to refine; the others take part as they are. By default all.

    Returns
    -------
    (n, 3) float64
        Outward unit normals.

    Examples
    --------
    >>> from face_plugin.geometry import unit
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> rough = unit(ball.normals + 0.3 * np.random.default_rng(0).normal(size=(500, 3)))
    >>> refined = refine(Neighbourhood(ball.points), rough, np.ones(500))
    >>> bool(((refined * ball.normals).sum(axis=1) > 0.99).all())
    True
    """
    points, neighbour = around.points, around.neighbour
    still = np.zeros(len(points), dtype=np.bool_) if moving is None else ~moving
    # Plates thinner than the spacing look like noise: there the field alone tells the side, and a fit the angle.
    plate = back_to_back(around, votes)

    # 1. Side: stray points turn round to those around them.
    side = turn_sides(around, votes, strength, sheets or find_sheets(around), plate | still)

    # 2. Angle: from fits to neighbours on the same smooth piece of the surface, as many as noise asks for and bending
    # allows, and from a narrow kernel where the points only just resolve the surface.
    turned = turn_angles(around, side, plate, still)

    # 3. Borders: where a sheet ends in the open, the field has a say in the angle as well.
    refined = bend_borders(points, turned.normals, votes, strength, neighbour)

    # 4. Level: the surface that the normals describe together is made to pass through the points.
    weight = level_weight(around.distance, neighbour, 1.0 - turned.resolved, turned.residual)
    refined = level(around.tree, refined, neighbour, turned.width, weight)
    return np.where(still[:, None], votes, refined)
