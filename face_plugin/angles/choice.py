"""The normal that the fits around a point tell together: each by how little it can be wrong there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.angles.fits import ROOT, SAME_SIDE, LocalFits
from face_plugin.compiled import compiled
from face_plugin.threads import in_threads

__all__ = [
    "FLATNESS",
    "FOLD_PLANE",
    "FOLD_QUADRIC",
    "LEAST",
    "OFF",
    "RIM",
    "TOLERANCE",
    "combine_fits",
]

# Fits of this many nearest points are looked at, the point's own among them: near an edge, those a little way into the
# face that the point lies on do not see the edge.
AROUND = 25
# Slope of a fold through the middle of a fit, in residuals (root mean square) over its reach: what a residual that is
# no noise may mean for the angle. Quadrics bend away from their middle: the more, the nearer the point lies to the rim.
FOLD_PLANE = 7.0
FOLD_QUADRIC = 8.0
RIM = 3.0
# Residuals up to this many standard deviations of the noise's own variance count as noise.
TOLERANCE = 6.0
# No surface is a plane or a quadric to better than this fraction of a fit's reach. It keeps fits to points on one line
# from being exact.
FLATNESS = 0.01
# A point farther than this many standard deviations of the noise off a fit does not lie on it.
OFF = 2.0
# Least squared error of a normal, in squared radians: below, errors are as good as none.
LEAST = 1e-9
# Fits that claim to know better than they agree: where the mean of their unit normals is shorter than 1 by this much
# (26 degrees to either side), it counts no more than the direction that the side was found in. So a point on a sharp
# edge lies between its faces, and not on one of them by chance.
APART = 0.1


def combine_fits(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    side: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    fits: LocalFits,
    noise: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Average the normals of all fits that contain a point, each by the inverse of its expected squared error.

    The error of a fit's normal has two parts. Noise turns it by chance: its variance times the fit's `gain`, less for
    larger fits. Edges and curvature that the fit does not follow turn it for certain: they show as a residual beyond
    the noise, and bound the slope that they may hide. A larger fit has less of the first and more of the second; a fit
    around a neighbour farther from the edge has less of the second, and is as good for every point that it contains.
    Fits around neighbours also pay for what the noise may hide from them.

    What each fit cannot know is that it lies on another face than the point. That shows where they contradict one
    another: with the length R of the mean of their unit normals, the mean and `side` are added in the proportion
    APART^2 to (1 - R)^2.

    Parameters
    ----------
    points, normals : (n, 3) float64
        Unit normals, the same that were fitted with.
    side : (n, 3) float64
        Unit normals of the right side, smooth across edges.
    neighbour : (n, k) intp
        Nearest points, ascending, the point itself first.
    fits : LocalFits
    noise : (n,) float64
        Variance of the points' noise.

    Returns
    -------
    found : (n, 3) float64
        Unit normals; those given where there is no fit.
    error : (n,) float64
        Expected squared error of the best fit, in squared radians; infinite where there is none.

    Examples
    --------
    >>> from scipy.spatial import cKDTree
    >>> from face_plugin.angles.fits import fit_surfaces
    >>> x, y = (a.ravel() for a in np.mgrid[0:10:0.5, 0:10:0.5])
    >>> roof = np.stack([x, y, -np.abs(x - 4.9)], axis=1)
    >>> slopes = np.stack([np.sign(x - 4.9), 0 * x, 1 + 0 * x], axis=1) / np.sqrt(2)
    >>> near = cKDTree(roof).query(roof, k=97)[1]
    >>> up = np.tile([0.0, 0, 1], (400, 1))
    >>> found, _ = combine_fits(roof, up, up, near, fit_surfaces(roof, up, near), np.zeros(400))
    >>> bool(((found * slopes).sum(axis=1) > 0.99).mean() > 0.9)
    True
    """
    n = len(points)
    found, error = np.array(normals, dtype=np.float64), np.full(n, np.inf)
    if len(fits.reach):
        around = np.ascontiguousarray(neighbour[:, :AROUND])
        points, normals, side, noise = (np.ascontiguousarray(array) for array in (points, normals, side, noise))

        def run(rows: slice) -> None:
            _combine(
                rows.start, rows.stop, points, normals, side, noise, around, fits.frame, fits.plane, fits.quadric,
                fits.variance, fits.gain, fits.reach, fits.used, found, error,
            )  # fmt: skip

        in_threads(run, n)
    return found, error


@compiled(nogil=True)
def _combine(  # type: ignore[no-untyped-def]
    first, last, points, normals, side, noise, around, frame, plane, quadric, variance, gain, reach, used, found, error
):
    for i in range(first, last):
        n0, n1, n2 = normals[i, 0], normals[i, 1], normals[i, 2]
        sum0, sum1, sum2, total = 0.0, 0.0, 0.0, 0.0
        sigma = noise[i]
        for t in range(around.shape[1]):
            j = around[i, t]
            if t > 0 and normals[j, 0] * n0 + normals[j, 1] * n1 + normals[j, 2] * n2 < SAME_SIDE:
                continue
            d0, d1, d2 = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
            far = d0 * d0 + d1 * d1 + d2 * d2
            x = d0 * frame[j, 0, 0] + d1 * frame[j, 0, 1] + d2 * frame[j, 0, 2]
            y = d0 * frame[j, 1, 0] + d1 * frame[j, 1, 1] + d2 * frame[j, 1, 2]
            z = d0 * frame[j, 2, 0] + d1 * frame[j, 2, 1] + d2 * frame[j, 2, 2]
            for s in range(len(reach)):
                r = reach[s, j]
                off_middle = far / (r * r)
                # The farthest of a fit's neighbours belongs to it, whatever rounding says.
                if off_middle > 1.0 + 1e-9:
                    continue
                u, v = x / r, y / r
                for model in range(2):
                    rest = variance[s, j, model]
                    if rest == np.inf:
                        continue
                    if model == 0:
                        unknowns, fold, rim = 3.0, FOLD_PLANE, 1.0
                        p = plane[s, j]
                        height, slope_u, slope_v = p[0] + p[1] * u + p[2] * v, p[1], p[2]
                    else:
                        unknowns, fold, rim = 6.0, FOLD_QUADRIC, 1.0 + RIM * off_middle
                        p = quadric[s, j]
                        xy = ROOT * p[4]
                        height = p[0] + (p[1] + p[3] * u + xy * v) * u + (p[2] + p[5] * v) * v
                        slope_u = p[1] + 2.0 * p[3] * u + xy * v
                        slope_v = p[2] + xy * u + 2.0 * p[5] * v
                    doubt = TOLERANCE * sigma * np.sqrt(2.0 / (used[s, j] - unknowns))
                    beyond = max(0.0, rest - sigma - doubt)
                    if t > 0:
                        beyond += doubt
                    own = z - height * r
                    beyond += max(0.0, own * own - OFF * OFF * sigma)
                    bias = fold * rim / r
                    chance = gain[s, j, model] * rim * (sigma + FLATNESS * FLATNESS * r * r)
                    wrong = bias * bias * beyond + chance + LEAST
                    error[i] = min(error[i], wrong)
                    weight = 1.0 / (wrong * np.sqrt(1.0 + slope_u * slope_u + slope_v * slope_v))
                    sum0 += weight * (frame[j, 2, 0] - slope_u * frame[j, 0, 0] - slope_v * frame[j, 1, 0])
                    sum1 += weight * (frame[j, 2, 1] - slope_u * frame[j, 0, 1] - slope_v * frame[j, 1, 1])
                    sum2 += weight * (frame[j, 2, 2] - slope_u * frame[j, 0, 2] - slope_v * frame[j, 1, 2])
                    total += 1.0 / wrong
        length = np.sqrt(sum0 * sum0 + sum1 * sum1 + sum2 * sum2)
        if length > 0.0:
            known, doubted = APART * APART / length, (1.0 - length / total) ** 2
            sum0, sum1, sum2 = (
                known * sum0 + doubted * side[i, 0],
                known * sum1 + doubted * side[i, 1],
                known * sum2 + doubted * side[i, 2],
            )
            length = np.sqrt(sum0 * sum0 + sum1 * sum1 + sum2 * sum2)
            found[i, 0], found[i, 1], found[i, 2] = sum0 / length, sum1 / length, sum2 / length
