"""From the field's rough normals to accurate ones.

E_max knows the side of nearly every point, but its gradient is accurate to ten degrees only. Two stages follow:

1. **Side.** A few steps of n <- -grad w / |grad w|, the winding-number field of the oriented points, turn the stray
   points round. The kernel is as wide as the distance to the next sheet of the surface allows, so it bridges gaps
   and noise and does not reach across thin walls.
2. **Angle.** Quadrics are fitted to more and more neighbours as long as the residual does not grow with them: it does
   where the surface is resolved (then the smallest fit is already too large, and narrow winding-number steps take
   over), and does not where points scatter about it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.fits import plane_fit, quadric_fits
from face_plugin.normals import unit
from face_plugin.winding import DipoleTree

__all__ = ["refine"]

# Neighbours looked at: the widest kernel and the largest quadric follow from it.
NEIGHBOURS = 96
# Side: steps taken; kernel width as a fraction of the distance to the next sheet, and its bounds in spacings.
SIDE_STEPS = 14
# The side bears a coarser sum than the angle: about twice as fast, one to two degrees off.
SIDE_OPENING = 0.6
SIDE_WIDTH = 0.3
SIDE_BOUNDS = (0.3, 3.0)
# A neighbour farther than this many spacings, within 37 degrees of the normal, belongs to another sheet.
SHEET_DISTANCE = 1.2
SHEET_COSINE = 0.8
# A plate thinner than this many spacings: of PLATE_NEIGHBOURS at least PLATE_SHARE faces the other way, PLATE_BEHIND of
# those lies behind the point, PLATE_PARALLEL of all is parallel to within 45 degrees, for most points around.
PLATE_THICKNESS = 1.0
PLATE_NEIGHBOURS = 24
PLATE_SHARE = 0.25
PLATE_BEHIND = 0.9
PLATE_PARALLEL = 0.85
PLATE_MAJORITY = 0.4
SAME_LINE = 0.7
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
    points: NDArray[np.float64], normals: NDArray[np.float64], moving: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Refine rough outward normals by the points themselves.

    Parameters
    ----------
    points : (n, 3) float64
        Distinct; in Morton order for speed.
    normals : (n, 3) float64
        Rough outward unit normals, most of them on the right side; zero where nothing is known.
    moving : (n,) bool, optional
        Which normals to refine; the others take part as they are. By default all.

    Returns
    -------
    (n, 3) float64
        Outward unit normals.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> rough = unit(ball.normals + 0.3 * np.random.default_rng(0).normal(size=(500, 3)))
    >>> bool(((refine(ball.points, rough) * ball.normals).sum(axis=1) > 0.99).all())
    True
    """
    count = min(NEIGHBOURS + 1, len(points))
    distance, neighbour = cKDTree(points).query(points, k=count, workers=-1)
    spacing = distance[:, 1:7].mean(axis=1)
    tree = DipoleTree(points, spacing**2)

    reach = next_sheet(points, distance, neighbour, spacing)
    width = np.clip(SIDE_WIDTH * reach, SIDE_BOUNDS[0] * spacing, SIDE_BOUNDS[1] * spacing)
    plate = back_to_back(points, normals, neighbour, spacing)
    still = np.zeros(len(points), dtype=np.bool_) if moving is None else ~moving
    kept = plate | still
    width[kept] = 0.0
    rough = normals
    for _ in range(SIDE_STEPS):
        normals = np.where(kept[:, None], rough, unit(tree.outward(normals, width, SIDE_OPENING)))
    side = normals

    # Where nothing is known and nothing moved, any direction will do for the fit.
    fitted, scatter = choose_quadric(points, unit(normals), neighbour, spacing)
    scatter[plate] = 1.0
    width = np.sqrt(np.maximum((NEAREST * spacing) ** 2 - distance[:, 1] ** 2, (ANGLE_WIDTH * spacing) ** 2))
    plane = plane_fit(points, distance, neighbour, min(PLANE[0], count - 1), PLANE[1])
    resolved = (1.0 - scatter)[:, None]
    fitted = scatter[:, None] * _along(fitted, normals)
    width[still] = 0.0
    for _ in range(ANGLE_STEPS):
        narrow = unit(tree.outward(normals, width))
        normals = np.where(still[:, None], rough, unit(resolved * narrow + fitted))
    normals = unit(normals + PLANE_WEIGHT * resolved * _along(plane, normals))
    settled = scatter[neighbour].mean(axis=1) > OVERRULE
    normals = np.where(settled[:, None], _along(normals, side), normals)
    return np.where(still[:, None], rough, normals)


def _along(lines: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lines (n, 3) turned to the side of the normals."""
    return np.asarray(lines * np.where(np.einsum("nd,nd->n", lines, normals) < 0, -1.0, 1.0)[:, None])


def next_sheet(
    points: NDArray[np.float64],
    distance: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    spacing: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Distance (n,) from each point to the nearest other sheet of the surface, at most to its last neighbour.

    Needs no orientation: a neighbour along the normal, of either sign, lies on another sheet.
    """
    line = plane_fit(points, distance, neighbour, min(12, distance.shape[1] - 1), 1.0)
    reach = distance[:, -1].copy()
    for k in range(1, distance.shape[1]):
        along = np.abs(np.einsum("nd,nd->n", points[neighbour[:, k]] - points, line))
        hit = (along > SHEET_COSINE * distance[:, k]) & (distance[:, k] > SHEET_DISTANCE * spacing)
        np.minimum(reach, np.where(hit, distance[:, k], np.inf), out=reach)
    return reach


def back_to_back(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    spacing: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Find the points (n,) of plates thinner than the spacing, which only the field can tell from noise.

    In a plate about half of the neighbours face the other way, and nearly all of those lie behind the point, as it
    lies behind them. Where points scatter about one sheet, few face the other way, and as many in front as behind. A
    point belongs to a plate where most of its neighbours have this pattern, so that a plate's rim does, too.
    """
    near = neighbour[:, 1 : PLATE_NEIGHBOURS + 1]
    facing = np.einsum("nkd,nd->nk", normals[near], normals)
    offset = points[near] - points[:, None]
    depth = -np.einsum("nkd,nd->nk", offset, normals)
    behind = (depth > 0) & (np.einsum("nkd,nkd->nk", offset, normals[near]) > 0)
    behind &= depth < PLATE_THICKNESS * spacing[:, None]
    opposite = facing < -SAME_LINE
    count = opposite.sum(axis=1)
    parallel = (np.abs(facing) > SAME_LINE).mean(axis=1)
    pattern = (
        (count >= PLATE_SHARE * near.shape[1])
        & ((opposite & behind).sum(axis=1) >= PLATE_BEHIND * count)
        & (parallel > PLATE_PARALLEL)
    )
    return np.asarray(pattern[near].mean(axis=1) > PLATE_MAJORITY)


def choose_quadric(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    spacing: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find normals (n, 3) of the largest quadric that the neighbours bear, and how much (n,) they scatter, in [0, 1].

    The residual of noise is the same at every size; that of curvature grows with it.
    """
    counts = tuple(k for k in QUADRICS if k <= neighbour.shape[1])
    if len(counts) < 2:
        return normals, np.zeros(len(points))
    fitted, residual = quadric_fits(points, normals, neighbour, spacing, counts)
    residual = np.where(np.isfinite(residual), residual, np.nanmedian(residual, axis=1, keepdims=True))
    typical = np.array([np.percentile(r[neighbour], RESIDUAL_PERCENTILE, axis=1) for r in residual])
    smallest = np.maximum(typical[0], 1e-12)
    chosen = np.zeros(len(points), dtype=np.intp)
    for s in range(1, len(counts)):
        chosen[(typical[s] < RESIDUAL_GROWTH * smallest) & (chosen == s - 1)] = s
    scatter = _ramp(typical[0], SCATTER) * _ramp(typical[1] / smallest, GROWTH)
    return fitted[chosen, np.arange(len(points))], scatter


def _ramp(values: NDArray[np.float64], ends: tuple[float, float]) -> NDArray[np.float64]:
    """0 at the first end, 1 at the second, linear between."""
    return np.asarray(np.clip((values - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0))
