"""What lies outside of the alpha shape of points: where a ball of a given radius gets to from afar, between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

__all__ = ["AlphaShapes"]


class AlphaShapes:
    """Alpha shapes of points, for balls of any radius (Edelsbrunner and Mücke 1994).

    A ball passes a facet if the circle around that is wider than the ball; or, where a corner beside it lies in the
    least ball around it, if the spheres around both of its tetrahedra are.

    Parameters
    ----------
    points : (n, 3) float64
    corners : (t, 4) int
        Of the Delaunay tetrahedra of the points.

    Examples
    --------
    >>> from scipy.spatial import Delaunay
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(300).points
    >>> shapes = AlphaShapes(ball, Delaunay(ball).simplices)
    >>> [float(shapes.outside(np.full(300, radius)).mean()) for radius in (0.01, 0.5)]
    [1.0, 0.0]
    """

    def __init__(self, points: NDArray[np.float64], corners: NDArray[np.int32]) -> None:
        outside, size = len(corners), len(points)
        ordered = np.sort(corners, axis=1).astype(np.int64).T
        facet = np.concatenate([np.delete(ordered, k, axis=0) for k in range(4)], axis=1)
        of, apex = np.tile(np.arange(outside), 4), ordered.ravel()
        # Equal facets stand side by side then.
        first_two = facet[0] * size + facet[1]
        key = first_two * size + facet[2]
        order = np.argsort(key) if size**3 < 2**63 else np.lexsort((facet[2], first_two))
        key, of, apex = key[order], of[order], apex[order]
        same = np.append(key[1:] == key[:-1], False)
        first = np.flatnonzero(~np.roll(same, 1))
        beyond = np.where(same, np.roll(of, -1), outside)[first]
        # A facet of the hull has one tetrahedron, whose corner stands for both.
        apexes = apex[first], np.where(same, np.roll(apex, -1), apex)[first]
        facet, of, at = facet[:, order[first]], of[first], np.ascontiguousarray(points.T)
        # The sphere around a flat tetrahedron is as wide as numbers go.
        with np.errstate(over="ignore"):
            centre, circle = _circles(*(at[:, corner] for corner in facet))
            held = np.zeros(len(of), dtype=np.bool_)
            for one in apexes:
                held |= _length(at[:, one] - centre) < circle
            sphere = np.append(_spheres(*(at[:, corner] for corner in ordered)), np.inf)
        self._facet, self._of, self._beyond, self._count = facet, of, beyond, outside
        self._corners, self._sphere = ordered, sphere[:-1]
        self._passes = np.where(held, np.minimum(sphere[of], sphere[beyond]), circle)

    def outside(self, radius: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which tetrahedra (t,) a ball gets to from afar.

        Parameters
        ----------
        radius : (n,) float64
            Of the ball, at each point; its mean over a facet's corners counts.
        """
        through = self._passes > _mean(radius, self._facet)
        size = self._count + 1
        link = coo_matrix((np.ones(through.sum()), (self._of[through], self._beyond[through])), shape=(size, size))
        label = connected_components(link, directed=False)[1]
        return np.asarray(label[:-1] == label[-1])

    def roomy(self, radius: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which tetrahedra (t,) the ball fits between the points of; `radius` as of `outside`."""
        return np.asarray(self._sphere > _mean(radius, self._corners))


def _mean(values: NDArray[np.float64], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Mean (k,) of the values (n,) at some rows (c, k) each."""
    total = values[rows[0]]
    for row in rows[1:]:
        total = total + values[row]
    return np.asarray(total / len(rows))


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _length(a: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(_dot(a, a)))


def _circles(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (3, k) and radii (k,) of the circles through three points (3, k) each."""
    u, v = b - a, c - a
    n = _cross(u, v)
    offset = _cross(n, u) * _dot(v, v) + _cross(v, n) * _dot(u, u)
    offset /= np.maximum(2.0 * _dot(n, n), np.finfo(float).tiny)
    return a + offset, _length(offset)


def _spheres(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Radii (k,) of the spheres through four points (3, k) each."""
    u, v, w = b - a, c - a, d - a
    across = _cross(v, w)
    offset = _dot(u, u) * across + _dot(v, v) * _cross(w, u) + _dot(w, w) * _cross(u, v)
    return np.asarray(_length(offset) / np.maximum(2.0 * np.abs(_dot(u, across)), np.finfo(float).tiny))
