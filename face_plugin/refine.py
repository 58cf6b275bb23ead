"""From the field's rough normals to accurate ones.

E_max knows the side of nearly every point, but its gradient is accurate to ten degrees only. Four stages follow:

1. **Side.** A few steps of n <- -grad w / |grad w|, the winding-number field of the oriented points, turn the stray
   points round. The kernel is as wide as the distance to the next sheet of the surface allows, so it bridges gaps
   and noise and does not reach across thin walls. Where there is no sheet, as in a bar thinner than the spacing, a
   strong field keeps a vote; in the dark of a closed body, where the field is noise, its vote is forgotten.
2. **Angle.** Quadrics are fitted to more and more neighbours as long as the residual does not grow with them: it does
   where the surface is resolved (then the smallest fit is already too large, and narrow winding-number steps take
   over), and does not where points scatter about it.
3. **Borders.** Where a sheet ends in the open, the field has a say in the angle as well.
4. **Level.** Where the sampling is even and does not scatter, the surface that the normals describe together is made
   to pass through the points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.angles.borders import bend_borders
from face_plugin.angles.fits import choose_quadric
from face_plugin.angles.levelling import level, level_weight
from face_plugin.angles.turning import kernel_width, turn_angles
from face_plugin.geometry import neighbourhoods, unit
from face_plugin.sides.sheets import Sheets, back_to_back, find_sheets
from face_plugin.sides.steps import turn_sides
from face_plugin.winding import DipoleTree

__all__ = ["refine"]


def refine(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    strength: NDArray[np.float64],
    moving: NDArray[np.bool_] | None = None,
    sheets: Sheets | None = None,
) -> NDArray[np.float64]:
    """Refine rough outward normals by the points themselves.

    Parameters
    ----------
    points : (n, 3) float64
        Distinct; in Morton order for speed.
    normals : (n, 3) float64
        Rough outward unit normals, most of them on the right side; zero where nothing is known.
    strength : (n,) float64
        E_max at the points.
    moving : (n,) bool, optional
        Which normals to refine; the others take part as they are. By default all.
    sheets : Sheets, optional
        Of the points, where they are known already; those of points that do not move are not looked at.

    Returns
    -------
    (n, 3) float64
        Outward unit normals.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> rough = unit(ball.normals + 0.3 * np.random.default_rng(0).normal(size=(500, 3)))
    >>> bool(((refine(ball.points, rough, np.ones(500)) * ball.normals).sum(axis=1) > 0.99).all())
    True
    """
    distance, neighbour = neighbourhoods(points)
    spacing = distance[:, 1:7].mean(axis=1)
    tree = DipoleTree(points, spacing**2)
    plate = back_to_back(points, normals, neighbour, spacing)
    still = np.zeros(len(points), dtype=np.bool_) if moving is None else ~moving

    # 1. Stray points turned round.
    sheets = sheets or find_sheets(points, distance, neighbour)
    side = turn_sides(tree, normals, strength, sheets, spacing, neighbour, plate | still)

    # 2. Angles. Where nothing is known and nothing moved, any direction will do for the fit.
    fitted, scatter, residual = choose_quadric(points, unit(side), neighbour, spacing)
    scatter[plate] = 1.0
    width = np.where(still, 0.0, kernel_width(distance, spacing))
    refined = turn_angles(tree, side, fitted, scatter, width, distance, neighbour)

    # 3. Open borders.
    refined = bend_borders(points, refined, normals, strength, neighbour)

    # 4. Level.
    refined = level(tree, refined, neighbour, width, level_weight(distance, neighbour, scatter, residual))
    return np.where(still[:, None], normals, refined)
