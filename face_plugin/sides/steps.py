"""Steps of the winding number: stray sides turn round to those of the points around them.

E_max knows the side of nearly every point. A few steps of n <- -grad w / |grad w|, the winding-number field of the
oriented points, turn the stray ones round. The kernel is as wide as the distance to the next sheet of the surface
allows, so it bridges gaps and noise and does not reach across thin walls. Where there is no sheet, as in a bar thinner
than the spacing, a strong field keeps a vote; in the dark of a closed body, where the field is noise, its vote is
forgotten.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.geometry import log_ramp, ramp, unit
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.sheets import Sheets

__all__ = ["turn_sides"]

# Most steps taken, fewer where neither a point nor one of its nearest SETTLED_AROUND turned by more than SETTLED (in
# radians) in a step; kernel width as a fraction of the distance to the next sheet, and its bounds in spacings.
SIDE_STEPS = 36
SETTLED = 0.05
SETTLED_AROUND = 8
SIDE_WIDTH = 0.3
SIDE_BOUNDS = (0.3, 3.0)
# On a sheet the kernel may reach farther, to strokes many spacings away: at first up to this many spacings, then less
# and less, down to the bound above. A sheet is where `bulk` is below these values, fully and not at all.
WIDEST_KERNEL = 6.0
SHEET = (0.03, 0.1)
# The field keeps a vote, next to the unit jump of the winding number, where points form no sheet (`bulk` from, to) and
# stand out into the field (E_max from, to): bars thinner than the spacing, which look like noise but for their field.
VOTE = 0.5
NO_SHEET = (0.1, 0.4)
STANDING_OUT = (0.2, 2.0)
# In the dark that leaks into a closed body, the votes are those of one mesh: with another seed some turn, and whole
# patches follow. After this many steps, points with so little field where the winding number is near 1 lose what they
# have and take the side of those around them. A cup is as dark at its bottom, but its wall is not enclosed.
FORGET_AFTER = 4
FORGET_DARK = 1e-6
FORGET_ENCLOSED = 0.95


def turn_sides(
    around: Neighbourhood,
    rough: NDArray[np.float64],
    strength: NDArray[np.float64],
    sheets: Sheets,
    kept: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Turn stray normals (n, 3) round; those `kept` stay as they are.

    A side spreads from point to point, across wide gaps slowly: most points settle within a few steps, and what is
    still turning goes on without them.
    """
    spacing = around.spacing
    flat = 1.0 - ramp(sheets.bulk, SHEET)
    low, high = SIDE_BOUNDS[0] * spacing, SIDE_BOUNDS[1] * spacing
    narrow = np.clip(SIDE_WIDTH * sheets.near, low, high) ** (1.0 - flat)
    wide = np.maximum(SIDE_WIDTH * sheets.far, low)
    vote = VOTE * ramp(sheets.bulk, NO_SHEET) * log_ramp(strength, STANDING_OUT)
    vote = vote[:, None] * rough
    normals, turning = rough, np.flatnonzero(~kept)
    for step in range(SIDE_STEPS):
        if len(turning) == 0:
            break
        bound = WIDEST_KERNEL * (SIDE_BOUNDS[1] / WIDEST_KERNEL) ** (step / SIDE_STEPS)
        width = np.zeros(len(around))
        width[turning] = narrow[turning] * np.minimum(wide, bound * spacing)[turning] ** flat[turning]
        # In units of the jump across an infinite plane, 4 pi |grad w| = 2 pi / width.
        outward, number = around.tree.outward_and_number(normals, width)
        jump = outward[turning] * (width[turning] / (2.0 * np.pi))[:, None]
        turned = normals.copy()
        turned[turning] = unit(jump + vote[turning])
        if step + 1 == FORGET_AFTER:
            turned[turning[(strength < FORGET_DARK)[turning] & (number > FORGET_ENCLOSED)[turning]]] = 0.0
        if step + 1 >= FORGET_AFTER:
            moved = np.einsum("nd,nd->n", turned, normals) < np.cos(SETTLED)
            near = moved.copy()
            for column in around.neighbour[:, 1 : SETTLED_AROUND + 1].T:
                near |= moved[column]
            turning = np.flatnonzero(near & ~kept)
        normals = turned
    return normals
