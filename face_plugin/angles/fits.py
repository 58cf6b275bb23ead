"""Local fits: planes and quadrics through each point's neighbours, at several sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.threads import in_threads

__all__ = ["MOST", "SAME_SIDE", "WEIGHT_WIDTH", "LocalFits", "fit_surfaces"]

# Neighbours of a fit, the point itself among them: each size twice the last, from twice the coefficients of a quadric.
SIZES = (12, 24, 48, 96)
# Neighbours take part where their normal is within 60 degrees: not the other side of a wall or of an edge.
SAME_SIDE = 0.5
# Width of the Gaussian weight, as a fraction of the distance to the farthest neighbour.
WEIGHT_WIDTH = 0.8
ROOT = 2.0**0.5
# A ball of points has the variance r^2 / 5 along any line: the neighbours, being the nearest, show no more of a noise
# that is wider than their ball. What shows is scaled up accordingly, at most tenfold.
BALL = 5.0
MOST = 10.0


@dataclass(frozen=True)
class LocalFits:
    """Fits z = f(x, y) over a tangent plane at each of n points, of s sizes; in units of each fit's `reach`.

    What could not be fitted has an infinite `variance`.
    """

    frame: NDArray[np.float64]
    """(n, 3, 3) unit axes x, y, z at each point, as rows."""
    plane: NDArray[np.float64]
    """(s, n, 3) coefficients of 1, x, y."""
    quadric: NDArray[np.float64]
    """(s, n, 6) coefficients of 1, x, y, xx, root(2) xy, yy: so a turn of the axes is a turn of the coefficients."""
    variance: NDArray[np.float64]
    """(s, n, 2) of the heights about the plane and the quadric, in the squared unit of the points."""
    gain: NDArray[np.float64]
    """(s, n, 2) variance of the slope at the point that heights of unit variance cause."""
    reach: NDArray[np.float64]
    """(s, n) distance to the farthest neighbour, in the points' unit."""
    used: NDArray[np.int64]
    """(s, n) neighbours that took part."""


def fit_surfaces(points: NDArray[np.float64], normals: NDArray[np.float64], neighbour: NDArray[np.intp]) -> LocalFits:
    """Fit planes and quadrics to each point's neighbours of the same side.

    Parameters
    ----------
    points, normals : (n, 3) float64
        Normals of the right side, accurate to some degrees.
    neighbour : (n, k) intp
        Nearest points, ascending, the point itself first. Sizes beyond k are left out.

    Examples
    --------
    >>> from scipy.spatial import cKDTree
    >>> x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    >>> bowl = np.stack([x.ravel(), y.ravel(), 0.05 * (x**2 + y**2).ravel()], axis=1)
    >>> up = np.tile([0.0, 0.0, 1.0], (36, 1))
    >>> fits = fit_surfaces(bowl, up, cKDTree(bowl).query(bowl, k=12)[1])
    >>> bool(fits.variance[0, :, 1].max() < 1e-5 < fits.variance[0, :, 0].min())
    True
    """
    n = len(points)
    sizes = np.array([size for size in SIZES if size <= neighbour.shape[1]], dtype=np.int64)
    s = len(sizes)
    fits = LocalFits(
        frame=np.zeros((n, 3, 3)),
        plane=np.zeros((s, n, 3)),
        quadric=np.zeros((s, n, 6)),
        variance=np.full((s, n, 2), np.inf),
        gain=np.full((s, n, 2), np.inf),
        reach=np.ones((s, n)),
        used=np.zeros((s, n), dtype=np.int64),
    )
    if s == 0:
        return fits
    points, normals, neighbour = (
        np.ascontiguousarray(points),
        np.ascontiguousarray(normals),
        np.ascontiguousarray(neighbour),
    )

    def run(rows: slice) -> None:
        _fit(
            rows.start, rows.stop, points, normals, neighbour, sizes,
            fits.frame, fits.plane, fits.quadric, fits.variance, fits.gain, fits.reach, fits.used,
        )  # fmt: skip

    in_threads(run, n)
    return fits


@compiled(nogil=True)
def _fit(  # type: ignore[no-untyped-def]
    first, last, points, normals, neighbour, sizes, frame, plane, quadric, variance, gain, reach, used
):
    local = np.empty((sizes[-1], 3))
    squared = np.empty(sizes[-1])
    f, b, x = np.empty(6), np.empty(6), np.empty(6)
    a, factor = np.empty((6, 6)), np.empty((6, 6))
    for i in range(first, last):
        n0, n1, n2 = normals[i, 0], normals[i, 1], normals[i, 2]
        # Tangent axes: cross the normal with the coordinate axis that it is farthest from.
        if abs(n0) <= abs(n1) and abs(n0) <= abs(n2):
            x0, x1, x2 = 0.0, n2, -n1
        elif abs(n1) <= abs(n2):
            x0, x1, x2 = -n2, 0.0, n0
        else:
            x0, x1, x2 = n1, -n0, 0.0
        length = np.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
        x0, x1, x2 = x0 / length, x1 / length, x2 / length
        y0, y1, y2 = n1 * x2 - n2 * x1, n2 * x0 - n0 * x2, n0 * x1 - n1 * x0
        frame[i, 0, 0], frame[i, 0, 1], frame[i, 0, 2] = x0, x1, x2
        frame[i, 1, 0], frame[i, 1, 1], frame[i, 1, 2] = y0, y1, y2
        frame[i, 2, 0], frame[i, 2, 1], frame[i, 2, 2] = n0, n1, n2
        m, s = 0, 0
        for k in range(sizes[-1]):
            j = neighbour[i, k]
            if k == 0 or normals[j, 0] * n0 + normals[j, 1] * n1 + normals[j, 2] * n2 >= SAME_SIDE:
                d0, d1, d2 = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                local[m, 0] = d0 * x0 + d1 * x1 + d2 * x2
                local[m, 1] = d0 * y0 + d1 * y1 + d2 * y2
                local[m, 2] = d0 * n0 + d1 * n1 + d2 * n2
                squared[m] = d0 * d0 + d1 * d1 + d2 * d2
                m += 1
            if k + 1 < sizes[s]:
                continue
            used[s, i] = m
            s += 1
            if m < 5:
                continue
            far = squared[m - 1]
            r = np.sqrt(far)
            reach[s - 1, i] = r
            for p in range(6):
                b[p] = 0.0
                for q in range(6):
                    a[p, q] = 0.0
            total, weights, doubled = 0.0, 0.0, 0.0
            for t in range(m):
                u, v, c = local[t, 0] / r, local[t, 1] / r, local[t, 2] / r
                w = np.exp(-squared[t] / far / (WEIGHT_WIDTH * WEIGHT_WIDTH))
                f[0], f[1], f[2], f[3], f[4], f[5] = 1.0, u, v, u * u, ROOT * u * v, v * v
                for p in range(6):
                    b[p] += w * f[p] * c
                    for q in range(p + 1):
                        a[p, q] += w * f[p] * f[q]
                total += w * c * c
                weights += w
                doubled += w * w
            for model in range(2):
                unknowns = 3 if model == 0 else 6
                if m < unknowns + 2:
                    continue
                # Cholesky's factor of the normal equations; the ridge keeps points on one line solvable.
                for p in range(unknowns):
                    for q in range(p + 1):
                        z = a[p, q]
                        if p == q:
                            z += 1e-7 * weights
                        for o in range(q):
                            z -= factor[p, o] * factor[q, o]
                        factor[p, q] = np.sqrt(max(z, 1e-12)) if p == q else z / factor[q, q]
                rest = total
                for p in range(unknowns):
                    z = b[p]
                    for o in range(p):
                        z -= factor[p, o] * x[o]
                    x[p] = z / factor[p, p]
                    rest -= x[p] * x[p]
                for p in range(unknowns - 1, -1, -1):
                    z = x[p]
                    for o in range(p + 1, unknowns):
                        z -= factor[o, p] * x[o]
                    x[p] = z / factor[p, p]
                for p in range(unknowns):
                    if model == 0:
                        plane[s - 1, i, p] = x[p]
                    else:
                        quadric[s - 1, i, p] = x[p]
                shown = max(rest, 0.0) / weights * m / (m - unknowns)
                variance[s - 1, i, model] = far * shown / max(1.0 / MOST, 1.0 - BALL * shown)
                # The slope's share of the inverse: squares of the factor's solutions for its two unit vectors.
                trace = 0.0
                for column in range(1, 3):
                    for p in range(unknowns):
                        z = 1.0 if p == column else 0.0
                        for o in range(p):
                            z -= factor[p, o] * x[o]
                        x[p] = z / factor[p, p]
                        trace += x[p] * x[p]
                gain[s - 1, i, model] = trace * doubled / weights / far
            if s == len(sizes):
                break
