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
        facet = np.sort(np.concatenate([np.delete(corners, k, axis=1) for k in range(4)]).astype(np.int64), axis=1)
        of, apex = np.tile(np.arange(outside), 4), corners.T.ravel()
        # Equal facets stand side by side then.
        order = np.lexsort((facet[:, 2], facet[:, 0] * size + facet[:, 1]))
        facet, of, apex = facet[order], of[order], apex[order]
        same = np.append((facet[1:] == facet[:-1]).all(axis=1), False)
        first = np.flatnonzero(~np.roll(same, 1))
        beyond = np.where(same, np.roll(of, -1), outside)[first]
        # A facet of the hull has one tetrahedron, whose corner stands for both.
        apex = np.stack([apex, np.where(same, np.roll(apex, -1), apex)])[:, first]
        facet, of = facet[first], of[first]
        # The sphere around a flat tetrahedron is as wide as numbers go.
        with np.errstate(over="ignore"):
            centre, circle = _circles(*(points[facet[:, k]] for k in range(3)))
            held = (np.linalg.norm(points[apex] - centre, axis=2) < circle).any(axis=0)
            sphere = np.append(_spheres(*(points[corners[:, k]] for k in range(4))), np.inf)
        self._facet, self._of, self._beyond, self._count = facet, of, beyond, outside
        self._corners, self._sphere = corners, sphere[:-1]
        self._passes = np.where(held, np.minimum(sphere[of], sphere[beyond]), circle)

    def outside(self, radius: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which tetrahedra (t,) a ball gets to from afar.

        Parameters
        ----------
        radius : (n,) float64
            Of the ball, at each point; its mean over a facet's corners counts.
        """
        through = self._passes > radius[self._facet].mean(axis=1)
        size = self._count + 1
        link = coo_matrix((np.ones(through.sum()), (self._of[through], self._beyond[through])), shape=(size, size))
        label = connected_components(link, directed=False)[1]
        return np.asarray(label[:-1] == label[-1])

    def roomy(self, radius: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which tetrahedra (t,) the ball fits between the points of; `radius` as of `outside`."""
        return np.asarray(self._sphere > radius[self._corners].mean(axis=1))


def _circles(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (k, 3) and radii (k,) of the circles through three points (k, 3) each."""
    u, v = b - a, c - a
    n = np.cross(u, v)
    uu, vv, nn = (np.einsum("kd,kd->k", x, x)[:, None] for x in (u, v, n))
    offset = (np.cross(n, u) * vv + np.cross(v, n) * uu) / np.maximum(2.0 * nn, np.finfo(float).tiny)
    return a + offset, np.linalg.norm(offset, axis=1)


def _spheres(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Radii (k,) of the spheres through four points (k, 3) each."""
    u, v, w = b - a, c - a, d - a
    uu, vv, ww = (np.einsum("kd,kd->k", x, x)[:, None] for x in (u, v, w))
    across = np.cross(v, w)
    offset = uu * across + vv * np.cross(w, u) + ww * np.cross(u, v)
    return np.asarray(
        np.linalg.norm(offset, axis=1)
        / np.maximum(2.0 * np.abs(np.einsum("kd,kd->k", u, across)), np.finfo(float).tiny)
    )
