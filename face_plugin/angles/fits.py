"""Local fits: quadrics through a point's neighbours, and the largest that these bear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.geometry import in_threads, ramp

__all__ = ["choose_quadric", "quadric_fits"]

# Fewest neighbours that determine a quadric's six coefficients with something to spare.
ENOUGH = 8
# Neighbours take part in a fit where their normal is within 60 degrees: not the other side of a wall or an edge.
SAME_SIDE = 0.5
# Width of the quadrics' weight, as a fraction of the distance to the farthest neighbour.
WEIGHT_WIDTH = 0.8
# Angle: neighbours of the quadrics; a larger one is taken while its residual is below this multiple of the smallest's.
QUADRICS = (12, 18, 30, 48)
RESIDUAL_GROWTH = 1.35
# The quadric takes over from the narrow kernel between these residuals (in spacings) and as the residual's growth over
# the first two sizes falls between these: at the left the surface is resolved, at the right points scatter about it.
SCATTER = (0.11, 0.27)
GROWTH = (1.4, 1.1)
# Residuals are compared by this percentile over the neighbourhood: scatter sits where sheets overlap, not everywhere.
RESIDUAL_PERCENTILE = 75.0


def quadric_fits(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    spacing: NDArray[np.float64],
    counts: tuple[int, ...],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit z = q(x, y), a quadric over each point's tangent plane, to its neighbours of the same side.

    Parameters
    ----------
    points, normals : (n, 3) float64
    neighbour : (n, k) intp
        Nearest points, ascending, the point itself first.
    spacing : (n,) float64
        Local unit of length: residuals are given in it.
    counts : tuple of s int
        Numbers of neighbours to fit to, ascending, the largest at most k.

    Returns
    -------
    fitted : (s, n, 3) float64
        Unit normals of the quadrics at the points; the given ones where too few neighbours are on the same side.
    residual : (s, n) float64
        Root mean square distance to the quadric, in spacings, corrected for its six coefficients; NaN there.

    Examples
    --------
    >>> from scipy.spatial import cKDTree
    >>> x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    >>> bowl = np.stack([x.ravel(), y.ravel(), 0.05 * (x**2 + y**2).ravel()], axis=1)
    >>> up = np.tile([0.0, 0.0, 1.0], (36, 1))
    >>> fitted, residual = quadric_fits(bowl, up, cKDTree(bowl).query(bowl, k=12)[1], np.ones(36), (12,))
    >>> bool(fitted[0, 0, 2] > 0.9), bool(residual.max() < 0.05)
    (True, True)
    """
    fitted = np.repeat(normals[None], len(counts), axis=0)
    residual = np.full((len(counts), len(points)), np.nan)
    number = np.asarray(counts, dtype=np.int64)
    neighbour = np.ascontiguousarray(neighbour)

    def run(rows: slice) -> None:
        _quadrics(rows.start, rows.stop, points, normals, neighbour, spacing, number, fitted, residual)

    in_threads(run, len(points))
    return fitted, residual


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


@compiled(nogil=True)
def _quadrics(first, last, points, normals, neighbour, spacing, counts, fitted, residual):  # type: ignore[no-untyped-def]
    most = neighbour.shape[1]
    local = np.empty((most, 3))
    squared = np.empty(most)
    f = np.empty(6)
    for i in range(first, last):
        n0, n1, n2 = normals[i, 0], normals[i, 1], normals[i, 2]
        # Tangent axes: cross the normal with the coordinate axis that it is farthest from.
        if abs(n0) <= abs(n1) and abs(n0) <= abs(n2):
            x0, x1, x2 = 0.0, n2, -n1
        elif abs(n1) <= abs(n2):
            x0, x1, x2 = -n2, 0.0, n0
        else:
            x0, x1, x2 = n1, -n0, 0.0
        norm = np.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
        x0, x1, x2 = x0 / norm, x1 / norm, x2 / norm
        y0, y1, y2 = n1 * x2 - n2 * x1, n2 * x0 - n0 * x2, n0 * x1 - n1 * x0
        for s in range(len(counts)):
            m = 0
            for k in range(min(counts[s], most)):
                j = neighbour[i, k]
                if normals[j, 0] * n0 + normals[j, 1] * n1 + normals[j, 2] * n2 < SAME_SIDE:
                    continue
                d0 = (points[j, 0] - points[i, 0]) / spacing[i]
                d1 = (points[j, 1] - points[i, 1]) / spacing[i]
                d2 = (points[j, 2] - points[i, 2]) / spacing[i]
                local[m, 0] = d0 * x0 + d1 * x1 + d2 * x2
                local[m, 1] = d0 * y0 + d1 * y1 + d2 * y2
                local[m, 2] = d0 * n0 + d1 * n1 + d2 * n2
                squared[m] = d0 * d0 + d1 * d1 + d2 * d2
                m += 1
            if m < ENOUGH:
                continue
            width = WEIGHT_WIDTH * WEIGHT_WIDTH * squared[m - 1]
            a = np.zeros((6, 6))
            b = np.zeros(6)
            total, weights = 0.0, 0.0
            for k in range(m):
                u, v, c = local[k, 0], local[k, 1], local[k, 2]
                w = np.exp(-squared[k] / width)
                f[0], f[1], f[2], f[3], f[4], f[5] = 1.0, u, v, u * u, u * v, v * v
                for p in range(6):
                    b[p] += w * f[p] * c
                    for q in range(6):
                        a[p, q] += w * f[p] * f[q]
                total += w * c * c
                weights += w
            for p in range(6):
                a[p, p] += 1e-6 * weights
            coefficient = np.linalg.solve(a, b)
            rest = total
            for p in range(6):
                rest -= coefficient[p] * b[p]
            residual[s, i] = np.sqrt(max(rest, 0.0) / weights * m / (m - 6.0))
            g0 = n0 - coefficient[1] * x0 - coefficient[2] * y0
            g1 = n1 - coefficient[1] * x1 - coefficient[2] * y1
            g2 = n2 - coefficient[1] * x2 - coefficient[2] * y2
            norm = np.sqrt(g0 * g0 + g1 * g1 + g2 * g2)
            fitted[s, i, 0], fitted[s, i, 1], fitted[s, i, 2] = g0 / norm, g1 / norm, g2 / norm
