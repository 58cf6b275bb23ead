"""Planes through the neighbours of each point, and how far these lie on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.threads import in_threads

__all__ = ["covariances", "plane_fit", "plane_fits"]


def plane_fit(
    points: NDArray[np.float64],
    distance: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    count: int,
    width: float,
) -> NDArray[np.float64]:
    """Fit planes: unit normals (n, 3), of either sign; arguments as of `plane_fits`.

    Examples
    --------
    >>> flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> from face_plugin.threads import KDTree
    >>> abs(plane_fit(flat, *KDTree(flat).query(flat, k=4), count=3, width=1.0)[0]).round(6)
    array([0., 0., 1.])
    """
    return plane_fits(points, distance, neighbour, count, width)[0]


def plane_fits(
    points: NDArray[np.float64],
    distance: NDArray[np.float64],
    neighbour: NDArray[np.intp],
    count: int,
    width: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit a plane to each point's `count` nearest neighbours.

    Weights are Gaussian, of `width` times the mean distance to those neighbours.

    Parameters
    ----------
    points : (n, 3) float64
    distance, neighbour : (n, k) float64, (n, k) intp
        Of the nearest points, ascending, the point itself first; k > count.

    Returns
    -------
    lines : (n, 3) float64
        Unit normals of the planes, of either sign.
    flatness : (n,) float64
        1 less the ratio of the two lower eigenvalues of the covariance: 1 on a plane, 0 where there is none.

    Examples
    --------
    >>> flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> from face_plugin.threads import KDTree
    >>> plane_fits(flat, *KDTree(flat).query(flat, k=4), count=3, width=1.0)[1].round(6)
    array([1., 1., 1., 1.])
    """
    distance = distance[:, : count + 1]
    scale = width * distance[:, 1:].mean(axis=1, keepdims=True)
    weight = np.exp(-((distance / scale) ** 2))
    variance, axes = np.linalg.eigh(covariances(points, neighbour, weight))
    middle = np.maximum(variance[:, 1], np.finfo(float).tiny)
    return np.ascontiguousarray(axes[:, :, 0]), np.clip(1.0 - variance[:, 0] / middle, 0.0, 1.0)


def covariances(
    points: NDArray[np.float64], neighbour: NDArray[np.intp], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariances (n, 3, 3) of the weighted neighbours of each point.

    Parameters
    ----------
    points : (m, 3) float64
    neighbour : (n, k) intp
        The first of them belong to the weights.
    weight : (n, w) float64
        Not negative, positive in sum; w <= k.

    Examples
    --------
    >>> covariances(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), np.array([[0, 1]]), np.ones((1, 2)))[0, 0]
    array([1., 0., 0.])
    """
    out = np.empty((len(weight), 3, 3))
    points, neighbour = np.ascontiguousarray(points), np.ascontiguousarray(neighbour)
    in_threads(lambda rows: _covariances(rows.start, rows.stop, points, neighbour, weight, out), len(weight))
    return out


@compiled(nogil=True)
def _covariances(first, last, points, neighbour, weight, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        at = neighbour[i, 0]
        total, x, y, z = 0.0, 0.0, 0.0, 0.0
        xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(weight.shape[1]):
            j, w = neighbour[i, k], weight[i, k]
            dx, dy, dz = points[j, 0] - points[at, 0], points[j, 1] - points[at, 1], points[j, 2] - points[at, 2]
            total += w
            x, y, z = x + w * dx, y + w * dy, z + w * dz
        x, y, z = x / total, y / total, z / total
        for k in range(weight.shape[1]):
            j, w = neighbour[i, k], weight[i, k] / total
            dx = points[j, 0] - points[at, 0] - x
            dy = points[j, 1] - points[at, 1] - y
            dz = points[j, 2] - points[at, 2] - z
            xx, xy, xz = xx + w * dx * dx, xy + w * dx * dy, xz + w * dx * dz
            yy, yz, zz = yy + w * dy * dy, yz + w * dy * dz, zz + w * dz * dz
        out[i, 0, 0], out[i, 0, 1], out[i, 0, 2] = xx, xy, xz
        out[i, 1, 0], out[i, 1, 1], out[i, 1, 2] = xy, yy, yz
        out[i, 2, 0], out[i, 2, 1], out[i, 2, 2] = xz, yz, zz
