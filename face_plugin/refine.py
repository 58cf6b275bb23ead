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

from face_plugin.borders import bend_borders
from face_plugin.fits import plane_fit, quadric_fits
from face_plugin.levelling import level, level_weight
from face_plugin.normals import unit
from face_plugin.sheets import Sheets, back_to_back, find_sheets, log_ramp, neighbourhoods, ramp
from face_plugin.winding import DipoleTree

__all__ = ["refine"]

# Side: most steps taken, fewer where neither a point nor one of its nearest AROUND turned by more than SETTLED, in
# radians, in a step; kernel width as a fraction of the distance to the next sheet, and its bounds in spacings.
SIDE_STEPS = 36
SETTLED = 0.05
AROUND = 8
# The side bears a coarser sum than the angle: about twice as fast, one to two degrees off.
SIDE_OPENING = 0.6
SIDE_WIDTH = 0.3
SIDE_BOUNDS = (0.3, 3.0)
# On a sheet the kernel may reach farther, to strokes many spacings away: at first up to this many spacings, then less
# and less, down to the bound above. A sheet is where `bulk` is below these values, fully and not at all.
WIDEST = 6.0
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
# Angle: neighbours of the quadrics; a larger one is taken while its residual is below this multiple of the smallest's.
QUADRICS = (12, 18, 30, 48)
RESIDUAL_GROWTH = 1.35
# The quadric takes over from the narrow kernel between these residuals (in spacings) and as the residual's growth over
# the first two sizes falls between these: at the left the surface is resolved, at the right points scatter about it.
SCATTER = (0.11, 0.27)
GROWTH = (1.4, 1.1)
# Residuals are compared by this percentile over the neighbourhood: scatter sits where sheets overlap, not everywhere.
RESIDUAL_PERCENTILE = 75.0
# Angle where the surface is resolved: steps, kernel width in spacings, weight of the plane through 6 neighbours.
ANGLE_STEPS = 6
ANGLE_WIDTH = 0.1
PLANE_WEIGHT = 0.3
PLANE = (6, 0.7)
# Where the neighbourhood scatters more than this on average, the narrow kernel may not overrule the side.
OVERRULE = 0.02
# A neighbour nearer than this many spacings is a near-duplicate: the kernel is widened to it.
NEAREST = 0.6


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
    side = _sides(tree, normals, strength, sheets, spacing, neighbour, plate | still)

    # 2. Angles. Where nothing is known and nothing moved, any direction will do for the fit.
    fitted, scatter, residual = choose_quadric(points, unit(side), neighbour, spacing)
    scatter[plate] = 1.0
    width = np.sqrt(np.maximum((NEAREST * spacing) ** 2 - distance[:, 1] ** 2, (ANGLE_WIDTH * spacing) ** 2))
    width[still] = 0.0
    plane = plane_fit(points, distance, neighbour, min(PLANE[0], len(points) - 1), PLANE[1])
    refined = _angles(tree, side, fitted, plane, scatter, width)
    settled = scatter[neighbour].mean(axis=1) > OVERRULE
    refined = np.where(settled[:, None], _along(refined, side), refined)

    # 3. Open borders.
    refined = bend_borders(points, refined, normals, strength, neighbour)

    # 4. Level.
    refined = level(tree, refined, neighbour, width, level_weight(distance, neighbour, scatter, residual))
    return np.where(still[:, None], normals, refined)


def _sides(
    tree: DipoleTree,
    rough: NDArray[np.float64],
    strength: NDArray[np.float64],
    sheets: Sheets,
    spacing: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    kept: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Turn stray normals (n, 3) round; those `kept` stay as they are.

    A side spreads from point to point, across wide gaps slowly: most points settle within a few steps, and what is
    still turning goes on without them.
    """
    flat = 1.0 - ramp(sheets.bulk, SHEET)
    low, high = SIDE_BOUNDS[0] * spacing, SIDE_BOUNDS[1] * spacing
    narrow = np.clip(SIDE_WIDTH * sheets.near, low, high)
    wide = np.maximum(SIDE_WIDTH * sheets.far, low)
    vote = VOTE * ramp(sheets.bulk, NO_SHEET) * log_ramp(strength, STANDING_OUT)
    vote = vote[:, None] * rough
    normals = rough
    turning = ~kept
    for step in range(SIDE_STEPS):
        bound = WIDEST * (SIDE_BOUNDS[1] / WIDEST) ** (step / SIDE_STEPS)
        width = narrow ** (1.0 - flat) * np.minimum(wide, bound * spacing) ** flat
        width[~turning] = 0.0
        # In units of the jump across an infinite plane, 4 pi |grad w| = 2 pi / width.
        outward, number = tree.outward_and_number(normals, width, SIDE_OPENING)
        jump = outward * (width / (2.0 * np.pi))[:, None]
        turned = np.where(turning[:, None], unit(jump + vote), normals)
        if step + 1 == FORGET_AFTER:
            turned[~kept & (strength < FORGET_DARK) & (number > FORGET_ENCLOSED)] = 0.0
        if step + 1 >= FORGET_AFTER:
            moved = np.einsum("nd,nd->n", turned, normals) < np.cos(SETTLED)
            turning = moved[neighbour[:, : AROUND + 1]].any(axis=1) & ~kept
        normals = turned
    return normals


def _angles(
    tree: DipoleTree,
    side: NDArray[np.float64],
    fitted: NDArray[np.float64],
    plane: NDArray[np.float64],
    scatter: NDArray[np.float64],
    width: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Turn normals (n, 3) of the right side to the angle that kernels this wide, and the fits, tell; 0: they stay."""
    still = (width == 0.0)[:, None]
    resolved = (1.0 - scatter)[:, None]
    fitted = scatter[:, None] * _along(fitted, side)
    normals = side
    for _ in range(ANGLE_STEPS):
        narrow = unit(tree.outward(normals, width))
        normals = np.where(still, side, unit(resolved * narrow + fitted))
    return unit(normals + PLANE_WEIGHT * resolved * _along(plane, normals))


def _along(lines: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lines (n, 3) turned to the side of the normals."""
    return np.asarray(lines * np.where(np.einsum("nd,nd->n", lines, normals) < 0, -1.0, 1.0)[:, None])


def choose_quadric(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    spacing: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Find normals (n, 3) of the largest quadric that the neighbours bear, and how much (n,) they scatter, in [0, 1].

    The residual of noise is the same at every size; that of curvature grows with it. The last array is the residual
    (n,) of the smallest quadric, in spacings, as it is around each point.
    """
    counts = tuple(k for k in QUADRICS if k <= neighbour.shape[1])
    if len(counts) < 2:
        return normals, np.zeros(len(points)), np.zeros(len(points))
    fitted, residual = quadric_fits(points, normals, neighbour, spacing, counts)
    if not np.isfinite(residual[0]).any():
        return normals, np.zeros(len(points)), np.zeros(len(points))
    residual = np.where(np.isfinite(residual), residual, np.nanmedian(residual, axis=1, keepdims=True))
    typical = np.array([np.percentile(r[neighbour], RESIDUAL_PERCENTILE, axis=1) for r in residual])
    smallest = np.maximum(typical[0], 1e-12)
    chosen = np.zeros(len(points), dtype=np.intp)
    for s in range(1, len(counts)):
        chosen[(typical[s] < RESIDUAL_GROWTH * smallest) & (chosen == s - 1)] = s
    scatter = ramp(typical[0], SCATTER) * ramp(typical[1] / smallest, GROWTH)
    return fitted[chosen, np.arange(len(points))], scatter, typical[0]
