"""Normals at open borders, where only the field tells how the surface goes on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.geometry import log_ramp, ramp, unit

__all__ = ["bend_borders"]

# Neighbours whose centroid shows a border, and how far off it lies there (from, to), as a fraction of their mean
# distance: 0 within a sheet, 0.42 on a straight border.
NEIGHBOURS = 24
BORDER = (0.3, 0.5)
# A border is open where the field is strong (E_max from, to): between strokes side by side it is 1 at most.
OPEN = (1.0, 3.0)
# How much of the field's direction across the border is added.
BEND = 0.8


def bend_borders(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    field_normals: NDArray[np.float64],
    strength: NDArray[np.float64],
    neighbour: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Bend the normals at open borders outward over them.

    A fit to the points takes it that the sheet goes straight on beyond its border, and a reconstruction then runs on
    into the empty. The closed surface turns in there. Charges crowd at a free border, and the field at it points away
    over it: the more, the farther there is nothing.

    Parameters
    ----------
    points, normals : (n, 3) float64
    field_normals : (n, 3) float64
        Directions in which E_max grows; zero where nothing is known.
    strength : (n,) float64
        E_max at the points.
    neighbour : (n, k) intp
        Nearest points, ascending, the point itself first.

    Returns
    -------
    (n, 3) float64
        Unit normals.

    Examples
    --------
    >>> from scipy.spatial import cKDTree
    >>> x, y = np.meshgrid(np.arange(9.0), np.arange(9.0))
    >>> sheet = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    >>> up = np.tile([0.0, 0.0, 1.0], (81, 1))
    >>> away = unit(sheet - [4.0, 4.0, -4.0])
    >>> bent = bend_borders(sheet, up, away, np.full(81, 3.0), cKDTree(sheet).query(sheet, k=25)[1])
    >>> bool(bent[40, 2] == 1.0), bool(bent[44, 0] > 0.2)
    (True, True)
    """
    offset = points[neighbour[:, 1 : NEIGHBOURS + 1]] - points[:, None]
    inward = offset.mean(axis=1)
    inward -= normals * np.einsum("nd,nd->n", inward, normals)[:, None]
    off_centre = np.linalg.norm(inward, axis=1) / np.linalg.norm(offset, axis=2).mean(axis=1)
    over = -unit(inward)
    across = np.maximum(np.einsum("nd,nd->n", field_normals, over), 0.0)
    is_open = ramp(off_centre, BORDER) * log_ramp(strength, OPEN)
    return unit(normals + (BEND * is_open * across)[:, None] * over)
