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
# A sheet that is flat up to its border goes on flat: at most this many times what the normals of the neighbours differ
# by (root mean square, radians) is added.
GOES_ON = 4.0


def bend_borders(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    field_normals: NDArray[np.float64],
    strength: NDArray[np.float64],
    neighbour: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Bend the normals at open borders of curved sheets outward over them.

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
    >>> x, y = (a.ravel() for a in np.meshgrid(np.arange(-4.0, 5.0), np.arange(-4.0, 5.0)))
    >>> dome = np.stack([x, y, np.sqrt(100.0 - x**2 - y**2)], axis=1)
    >>> near = cKDTree(dome).query(dome, k=25)[1]
    >>> bent = bend_borders(dome, dome / 10, unit(dome * [1, 1, 0]), np.full(81, 3.0), near)
    >>> bool(bent[40, 2] > 0.999), bool(bent[44, 0] > dome[44, 0] / 10 + 0.2)
    (True, True)
    """
    near = neighbour[:, 1 : NEIGHBOURS + 1]
    offset = points[near] - points[:, None]
    # A fold is no border: seen along the mean normal, its two faces surround the point.
    mean = normals[near].mean(axis=1)
    bent = np.sqrt(2.0 * np.maximum(1.0 - np.linalg.norm(mean, axis=1), 0.0))
    mean = unit(mean)
    inward = offset.mean(axis=1)
    inward -= mean * np.einsum("nd,nd->n", inward, mean)[:, None]
    off_centre = np.linalg.norm(inward, axis=1) / np.linalg.norm(offset, axis=2).mean(axis=1)
    over = -unit(inward)
    across = np.maximum(np.einsum("nd,nd->n", field_normals, over), 0.0)
    is_open = ramp(off_centre, BORDER) * log_ramp(strength, OPEN)
    return unit(normals + np.minimum(BEND * is_open * across, GOES_ON * bent)[:, None] * over)
