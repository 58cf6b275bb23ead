"""The method, step by step: what is done to a cloud in one piece, and to each tile of a larger one.

    points -> strays -> cage -> mesh -> field | sights -> sides -> angles -> interior, confidence

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
from face_plugin.angles.curves import turn_to_curves
from face_plugin.angles.levelling import levelled, levelling_weight
from face_plugin.angles.turning import turn_angles
from face_plugin.faraday import field
from face_plugin.faraday.domain import Box
from face_plugin.faraday.gradient import FieldAtPoints
from face_plugin.faraday.solve import SolvedCage, solve_cage
from face_plugin.geometry import thin, unit
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.params import Params
from face_plugin.sides.blind import sides_as_seen, sides_by_field
from face_plugin.sides.curves import curve_separation, lines_of_curves, sides_of_curves
from face_plugin.sides.facing import as_faced, resettled, sides_by_sensors
from face_plugin.sides.patches import Planes, planes_of, shared_planes
from face_plugin.sides.reach import Reach
from face_plugin.sides.sheets import Sheets, back_to_back, cage_separation, find_sheets
from face_plugin.sides.vantage import is_open
from face_plugin.stages import Stage

__all__ = ["Solved", "orient", "refine", "refine_curves", "solve_field"]


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
    memory: float | None = None,
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
    box, given, cage_value, memory, stage
        As of `face_plugin.faraday.solve.solve_cage`; the stage "field" follows.
    """
    # Where balls go: near-duplicates are left out, and points on sheets with nothing else near.
    with stage("cage"):
        spacing = None if params.cage_spacing is None else params.cage_spacing / scale
        coarsen = params.angles == "refined"
        if around.plane:
            separation, sheets = curve_separation(around, spacing, coarsen=coarsen), None
        else:
            separation, sheets = cage_separation(around, spacing, coarsen=coarsen)
        rows = thin(around.points, separation, params.seed, (around.distance, around.neighbour))
    points = around.points
    # The neighbours take a tenth of the memory of what follows: who needs them no more need not hold them.
    del around
    # Balls (3.1), the box around them, the mesh between, and the potential of three basis fields (3.2).
    cage = solve_cage(points, rows, params, box=box, given=given, cage_value=cage_value, memory=memory, stage=stage)
    # The greatest strength that an external field of any direction causes (3.3).
    with stage("field"):
        strength = field.strength(cage.mesh, cage.potential, params.directions)
    return Solved(cage, strength, sheets)


def orient(
    around: Neighbourhood,
    field: FieldAtPoints,
    params: Params,
    *,
    plane: NDArray[np.float64] | None = None,
    sheets: Sheets | None = None,
    moving: NDArray[np.bool_] | None = None,
    sights: NDArray[np.float64] | None = None,
    reach: Reach | None = None,
    planes: Planes | None = None,
) -> NDArray[np.float64]:
    """From the field at the points, and what sensors saw, to their normals.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    field : FieldAtPoints
    params : Params
    plane : (3,) float64, optional
        Unit normal of the plane that all points lie in.
    sheets, moving, sights, reach, planes
        As of `refine`.

    Returns
    -------
    (n, d) float64
        Unit normals that point to free space.
    """
    if around.plane:
        return field.normals if params.angles == "field" else refine_curves(around, field)
    if plane is not None:
        # The field is the same on both sides of a sheet: its mean gradient lies in the sheet.
        normals = np.tile(plane, (len(around), 1))
        return normals if sights is None or np.sum(sights @ plane) >= 0 else -normals
    if params.angles == "field" and sights is None:
        # The strength grows outward, so its gradient at a ball points outward (3.4).
        return field.normals
    return refine(around, field, sheets, moving, sights, reach, planes)


def refine(
    around: Neighbourhood,
    field: FieldAtPoints,
    sheets: Sheets | None = None,
    moving: NDArray[np.bool_] | None = None,
    sights: NDArray[np.float64] | None = None,
    reach: Reach | None = None,
    planes: Planes | None = None,
) -> NDArray[np.float64]:
    """Refine rough outward normals by the points themselves: first their side, then their angle.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    field : FieldAtPoints
        Its `votes` are rough outward normals, most of them on the right side; zero where nothing is known.
    sheets : Sheets, optional
        Of the points, where they are known already; those of points that do not move are not looked at.
    moving : (n,) bool, optional
        Which normals to refine; the others take part as they are. By default all.
    sights : (n, 3) float64, optional
        Directions in which sensors saw the points, as `face_plugin.sides.sights.sights` has them: they decide on the
        sides then, and the field does not.
    reach : Reach, optional
        Of the points, where it is asked again later.
    planes : Planes, optional
        Of the points, where they are known already.

    Returns
    -------
    (n, 3) float64
        Unit normals that point to free space.

    Examples
    --------
    >>> from face_plugin.geometry import unit
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> rough = unit(ball.normals + 0.3 * np.random.default_rng(0).normal(size=(500, 3)))
    >>> refined = refine(Neighbourhood(ball.points), FieldAtPoints(np.ones(500), rough, np.ones(500)))
    >>> bool(((refined * ball.normals).sum(axis=1) > 0.99).all())
    True
    """
    points, neighbour = around.points, around.neighbour
    still = np.zeros(len(points), dtype=np.bool_) if moving is None else ~moving
    closed = not is_open(field.difference)
    as_seen = sights is None and not closed and not still.any()
    # Plates thinner than the spacing look like noise: there the field alone tells the side, and a fit the angle. Of
    # what encloses nothing the field tells no side.
    plate = np.zeros(len(points), dtype=np.bool_) if as_seen else back_to_back(around, field.votes)

    # 1. Side.
    planes = planes or planes_of(around)
    reach = reach or Reach(around)
    side = blind = sides_by_field(around, field, sheets or find_sheets(around), planes, reach, still, plate)
    if sights is not None or as_seen:
        # Sides are told of lines, and at the foot of a wall those of the nearest points are of neither sheet.
        planes = shared_planes(around, planes, sights)
    if sights is not None:
        side = sides_by_sensors(around, sights, unit(blind), planes)
        if closed:
            # Of closed bodies the field knows the normals better than planes do.
            side = as_faced(around, unit(blind), side)
    elif as_seen:
        side = sides_as_seen(around, field, side, planes)
    del planes

    # 2. Angle: from fits to neighbours on the same smooth piece of the surface, as many as noise asks for and bending
    # allows, and from a narrow kernel where the points only just resolve the surface.
    turned = turn_angles(around, side, plate, still)
    refined = turned.normals

    # 3. Borders: where the sheet of a body ends in the open, the field has a say in the angle as well. What encloses
    # nothing goes on as it is.
    if sights is None and closed:
        refined = bend_borders(points, refined, field.votes, field.strength, neighbour)

    # 4. Level: the surface that the normals describe together is made to pass through the points.
    weight = levelling_weight(around.distance, neighbour, turned.error)
    refined = levelled(around.tree, refined, neighbour, turned.width, weight)
    if sights is not None:
        # The angle is known better now, and so is which side of it was seen.
        refined = resettled(around, refined, sights, unit(blind))
    elif as_seen:
        refined = resettled(around, refined)
    return np.where(still[:, None], field.votes, refined)


def refine_curves(around: Neighbourhood, field: FieldAtPoints) -> NDArray[np.float64]:
    """Refine the normals of points in the plane, as `refine` does in space.

    Parameters
    ----------
    around : Neighbourhood
        Of the points (n, 2).
    field : FieldAtPoints

    Returns
    -------
    (n, 2) float64
        Unit normals that point to free space.

    Examples
    --------
    >>> from face_plugin.shapes.curves import circle
    >>> ring = circle(300)
    >>> rough = FieldAtPoints(np.ones(300), ring.normals, np.ones(300))
    >>> bool(((refine_curves(Neighbourhood(ring.points), rough) * ring.normals).sum(axis=1) > 0.999).all())
    True
    """
    # 1. Line: neighbours of any side tell it.
    lines = turn_to_curves(around, lines_of_curves(around).normals, signed=False)
    # 2. Side: along the curves, and by the field.
    side = sides_of_curves(lines.foot, lines.normals, lines.error, field.votes, field.lean)
    # 3. Angle: now that sides are known, the other bank of a slot takes no part.
    turned = turn_to_curves(around, lines.normals * side[:, None], signed=True)
    turned = turn_to_curves(around, turned.normals, signed=True)
    # A handful of points is no curve: the field knows as much.
    return np.where(np.isfinite(turned.error)[:, None], turned.normals, field.normals)
