"""The line of each normal: from fits where these are good, from narrow kernels where points are few."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.angles.choice import FLATNESS, LEAST, combine_fits
from face_plugin.angles.fits import LocalFits, fit_surfaces
from face_plugin.angles.noise import find_noise
from face_plugin.geometry import unit
from face_plugin.medians import medians
from face_plugin.neighbourhood import Neighbourhood

__all__ = ["Turned", "turn_angles"]

# Steps of the narrow kernel, after the first fits and after the second: these start from normals that the first made
# accurate, so that neighbours beyond an edge are told by them.
STEPS = (3, 6)
# Width of the kernel, in spacings, and the least distance at which it sees another point: it is widened where one is
# nearer, as near-duplicates are.
WIDTH = 0.1
NEAREST = 0.6
# Expected error of the kernel, as that of the fits: what the smallest quadrics around leave beyond the noise, in
# spacings, times the first; and the noise, its variance times their gain, times the second.
ROUGH = 2.0
NOISY = 12.0
# Where the kernel's part would be less than this, it is not computed.
LEAST_PART = 0.02


@dataclass(frozen=True)
class Turned:
    """Normals, and what else their angles tell of the surface."""

    normals: NDArray[np.float64]
    """(n, 3) unit normals."""
    error: NDArray[np.float64]
    """(n,) expected squared error, in squared radians: large where every point tells something new of the surface."""
    width: NDArray[np.float64]
    """(n,) of the kernel at each point; 0 where it had no part."""


def turn_angles(
    around: Neighbourhood, side: NDArray[np.float64], plate: NDArray[np.bool_], still: NDArray[np.bool_]
) -> Turned:
    """Turn normals of the right side to the angle that the points tell.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    side : (n, 3) float64
        Unit normals, most of them on the right side, accurate to some tens of degrees; zero where nothing is known.
    plate : (n,) bool
        Points of plates thinner than the spacing: the kernel would see both sides as one.
    still : (n,) bool
        Points whose normals stay as they are.

    Returns
    -------
    Turned
        Normals on the side of `side`.

    Examples
    --------
    >>> from face_plugin.shapes import box
    >>> cube = box(1000)
    >>> nobody = np.zeros(1000, dtype=bool)
    >>> turned = turn_angles(Neighbourhood(cube.points), cube.normals, nobody, nobody)
    >>> bool(((turned.normals * cube.normals).sum(axis=1) > 0.999).mean() > 0.98)
    True
    """
    normals = side = unit(side)
    spacing = around.spacing
    wide = np.sqrt(np.maximum((NEAREST * spacing) ** 2 - around.distance[:, 1] ** 2, (WIDTH * spacing) ** 2))
    for steps in STEPS:
        fits = fit_surfaces(around.points, normals, around.neighbour)
        noise, least = find_noise(around.points, fits, around.neighbour)
        line, error = combine_fits(around.points, normals, side, around.neighbour, fits, noise)
        fitted = np.where(still[:, None], side, _along(line, side))
        # Each by the inverse of its expected squared error.
        of_fits, of_kernel = 1.0 / error, 1.0 / _kernel_error(around, fits, noise, least)
        part = of_kernel / (of_fits + of_kernel)
        part[plate | still | (part < LEAST_PART)] = 0.0
        width = np.where(part > 0.0, wide, 0.0)
        normals = fitted
        for _ in range(steps):
            narrow = unit(around.tree.outward(normals, width))
            normals = unit(part[:, None] * narrow + (1.0 - part)[:, None] * fitted)
        normals = np.where(still[:, None], side, _along(normals, side))
    return Turned(normals, 1.0 / (of_fits + of_kernel), width)


def _kernel_error(
    around: Neighbourhood, fits: LocalFits, noise: NDArray[np.float64], least: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Guess the squared error (n,) of the kernel's normals, in squared radians.

    The kernel sees the nearest points alone: it follows what the smallest fit smooths over, and all of the noise. Where
    the nearest points lie on a line, as along a row of a scan, the gain of the smallest fit is as large as the kernel
    is wrong; on sharp edges, where nothing is fitted, that of the neighbours' stands for it.
    """
    if len(fits.reach) == 0:
        return np.full(len(around), LEAST)
    gain = fits.gain[0, :, 1]
    gain = np.where(np.isfinite(gain), gain, medians(gain, around.neighbour))
    rough = (ROUGH / around.spacing) ** 2 * (least - noise)
    chance = NOISY * gain * (noise + (FLATNESS * fits.reach[0]) ** 2)
    return np.asarray(np.clip(rough + chance, LEAST, np.pi**2))


def _along(lines: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lines (n, 3) turned to the side of the normals."""
    return np.asarray(lines * np.where(np.einsum("nd,nd->n", lines, normals) < 0, -1.0, 1.0)[:, None])
