"""Angles of normals whose side is known: from fits where points scatter, from narrow kernels where they do not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.geometry import plane_fit, unit
from face_plugin.winding import DipoleTree

__all__ = ["kernel_width", "turn_angles"]

# Angle where the surface is resolved: steps, kernel width in spacings, weight of the plane through 6 neighbours.
ANGLE_STEPS = 6
ANGLE_WIDTH = 0.1
PLANE_WEIGHT = 0.3
PLANE = (6, 0.7)
# Where the neighbourhood scatters more than this on average, the narrow kernel may not overrule the side.
OVERRULE = 0.02
# A neighbour nearer than this many spacings is a near-duplicate: the kernel is widened to it.
NEAREST = 0.6


def kernel_width(distance: NDArray[np.float64], spacing: NDArray[np.float64]) -> NDArray[np.float64]:
    """Width (n,) of the narrow kernel: a tenth of the spacing, more where the nearest point is a near-duplicate."""
    return np.asarray(np.sqrt(np.maximum((NEAREST * spacing) ** 2 - distance[:, 1] ** 2, (ANGLE_WIDTH * spacing) ** 2)))


def turn_angles(
    tree: DipoleTree,
    side: NDArray[np.float64],
    fitted: NDArray[np.float64],
    scatter: NDArray[np.float64],
    width: NDArray[np.float64],
    distance: NDArray[np.float64],
    neighbour: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Turn normals of the right side to the angle that the fits and narrow kernels tell.

    Parameters
    ----------
    tree : DipoleTree
        Of the points.
    side : (n, 3) float64
        Unit normals of the right side.
    fitted : (n, 3) float64
        Unit normals of quadrics, of either sign.
    scatter : (n,) float64
        How much the points scatter about their surface, in [0, 1].
    width : (n,) float64
        Of the narrow kernel at each point; 0: the normal stays.
    distance, neighbour : (n, k) float64, (n, k) intp
        Of the nearest points, ascending, the point itself first.

    Returns
    -------
    (n, 3) float64
        Unit normals.
    """
    plane = plane_fit(tree.points, distance, neighbour, min(PLANE[0], len(side) - 1), PLANE[1])
    refined = _angles(tree, side, fitted, plane, scatter, width)
    settled = scatter[neighbour].mean(axis=1) > OVERRULE
    return np.where(settled[:, None], _along(refined, side), refined)


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
