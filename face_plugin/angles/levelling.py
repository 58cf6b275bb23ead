"""Normals that agree with the positions: the surface that they describe together passes through the points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.geometry import ramp, unit
from face_plugin.medians import medians
from face_plugin.winding import DipoleTree

__all__ = ["levelled", "levelling_weight"]

# Gradient steps, and their length: with more or longer ones angles get worse than the surface gets better.
STEPS = 3
RATE = 1.45
# Area of a point of an even sampling, in squares of the mean distance to its 6 nearest.
AREA = 0.87
# A point off the surface by more than FARTHEST is no sample of one surface, and by more than FAR is as one off by FAR.
FAR = 0.25
FARTHEST = 0.35
# Weights rise from 0 to 1 (or fall from 1 to 0) between these. Nearest distance in spacings, mean of the 24 nearest:
# without an even sampling the areas are not known. Level itself, median of the 24 nearest: off where others cut in.
EVEN = (0.65, 0.72)
LEVEL = (0.12, 0.18)
# Squared error of what positions say of a normal (4 degrees), in squared radians.
POSITIONS = np.radians(4.0) ** 2
AROUND = 24


def levelling_weight(
    distance: NDArray[np.float64], neighbour: NDArray[np.intp], error: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How far (n,) the positions say more of the normals than is known already, in [0, 1].

    Parameters
    ----------
    distance, neighbour : (n, k) float64, (n, k) intp
        Of the nearest points, ascending, the point itself first; k > 6.
    error : (n,) float64
        Expected squared error of the normals, in squared radians: small where fits tell them, as where points scatter
        about a flat sheet.

    Examples
    --------
    >>> from scipy.spatial import cKDTree
    >>> from face_plugin.shapes import sphere
    >>> found = cKDTree(ball := sphere(500).points).query(ball, k=97)
    >>> bool(levelling_weight(*found, np.full(500, 0.1)).min() > 0.5)
    True
    """
    evenness = distance[:, 1] / distance[:, 1:7].mean(axis=1)
    even = ramp(evenness[neighbour[:, : AROUND + 1]].mean(axis=1), EVEN)
    return np.asarray(even * error / (error + POSITIONS))


def levelled(
    tree: DipoleTree,
    normals: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    width: NDArray[np.float64],
    weight: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Turn normals a little, so that the winding number w is 1/2 at the points themselves.

    Gradient steps on E = 1/2 sum_i a_i (w_i - 1/2)^2. With w_i = 1 / (4 pi) sum_j a_j n_j . (p_j - p_i) / r_ij^3,
    -dE/dn_j is a_j times the field that charges of a_i (w_i - 1/2) cause at p_j:
    1 / (4 pi) sum_i a_i (w_i - 1/2) (p_i - p_j) / r_ij^3. Poisson reconstruction puts the surface where w is 1/2.

    Parameters
    ----------
    tree : DipoleTree
        Of the points, with squared spacings as areas.
    normals : (n, 3) float64
        Outward, accurate to some degrees.
    neighbour : (n, k) intp
        Nearest points, ascending, the point itself first.
    width : (n,) float64
        Of the kernel at each point; 0 where the normal is to stay.
    weight : (n,) float64
        As `levelling_weight` has it.

    Returns
    -------
    (n, 3) float64
        Unit normals.

    Examples
    --------
    >>> from scipy.spatial import cKDTree
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> distance, neighbour = cKDTree(ball.points).query(ball.points, k=25)
    >>> tree = DipoleTree(ball.points, distance[:, 1:7].mean(axis=1) ** 2)
    >>> turned = levelled(tree, ball.normals, neighbour, 0.5 * distance[:, 1], np.ones(500))
    >>> bool(((turned * ball.normals).sum(axis=1) > 0.99).all())
    True
    """
    for step in range(STEPS):
        off = AREA * tree.number(normals, width) - 0.5
        if step == 0:
            typical = medians(np.abs(off), neighbour[:, : AROUND + 1])
            weight = weight * (1.0 - ramp(typical, LEVEL)) * (width > 0)
            width = np.where(weight > 0, width, 0.0)
        charge = weight * np.where(np.abs(off) < FARTHEST, np.clip(off, -FAR, FAR), 0.0)
        turn = [tree.number(np.outer(charge, axis), width) for axis in np.eye(3)]
        normals = unit(normals + RATE * AREA * weight[:, None] * np.stack(turn, axis=1))
    return normals
