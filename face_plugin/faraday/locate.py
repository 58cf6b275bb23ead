"""Values of the solved field anywhere in the box: find the tetrahedron of a position, interpolate in it.

The balls are holes in the mesh. They are filled first, so that a straight walk from tetrahedron to
tetrahedron cannot run into one; inside a ball the value is the mean over its cage vertices.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.faraday.gradient import ball_means
from face_plugin.faraday.isosurface import fill_balls
from face_plugin.faraday.meshers import CageMesh
from face_plugin.threads import KDTree

__all__ = ["Locator"]

# A barycentric coordinate may be this much below zero: a position on a facet belongs to either side.
SLACK = 1e-12
# The same where a walk does not end, since rounding decides between tetrahedra as small as that, or beside
# the crack that a dropped, flat tetrahedron leaves.
LOOSE = 1e-3
# A walk from the nearest vertex takes about five steps; one that takes more than this many runs in circles.
LONGEST_WALK = 500


class Locator:
    """Finds positions in a mesh, and interpolates values given at its vertices.

    Building it takes about as long as 30,000 queries, so keep it.

    Parameters
    ----------
    mesh : CageMesh

    Attributes
    ----------
    tets : (t + s, 4) int32
        Tetrahedra of the mesh, then those that fill its balls; the first vertex of these is a ball's centre,
        numbered after the vertices of the mesh in the order of the balls.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> from face_plugin.solver import FaCE
    >>> mesh = FaCE(sphere(200).points).mesh
    >>> height = Locator(mesh).interpolate(np.array([[0.1, 0.2, 0.3]]), mesh.vertices[:, 2])
    >>> height.round(12)
    array([0.3])
    """

    def __init__(self, mesh: CageMesh) -> None:
        self.mesh = mesh
        self._vertices, self.tets, _ = fill_balls(mesh, np.zeros(len(mesh.vertices)))
        self._start, self._incident = _incidence(self.tets, len(self._vertices))
        self._used = np.flatnonzero(np.diff(self._start))
        self._tree = KDTree(self._vertices[self._used])

    def find(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Tetrahedron that contains each position, and the barycentric coordinates in it.

        Parameters
        ----------
        points : (k, 3) float64, in the canonical frame

        Returns
        -------
        tet : (k,) int64
            Row of `tets`, -1 for a position outside the box.
        weights : (k, 4) float64
            Barycentric coordinates in [0, 1]; zero outside the box.
        """
        tet = np.full(len(points), -1, dtype=np.int64)
        weights = np.zeros((len(points), 4))
        inside = np.flatnonzero(((points >= self.mesh.lower) & (points <= self.mesh.upper)).all(axis=1))
        # The nearest vertex first; the walks that do not end from there start again at its neighbours.
        todo = inside
        for neighbour in (1, 2, 5):
            nearest = self._used[self._tree.query(points[todo], k=[neighbour])[1][:, 0]]
            tet[todo], weights[todo] = _walk(
                points[todo], self._vertices, self.tets, nearest, self._start, self._incident
            )
            todo = todo[tet[todo] < 0]
        if len(todo):
            tet[todo], weights[todo] = _least_outside(points[todo], self._vertices, self.tets)
        weights[inside] = np.clip(weights[inside], 0.0, 1.0)
        weights[inside] /= weights[inside].sum(axis=1, keepdims=True)
        return tet, weights

    def interpolate(
        self, points: NDArray[np.float64], values: NDArray[np.float64], *, outside: float = np.nan
    ) -> NDArray[np.float64]:
        """Interpolate values given at the vertices of the mesh.

        Parameters
        ----------
        points : (k, 3) float64, in the canonical frame
        values : (m,) or (m, s) float64
            Values at the vertices of the mesh, in any unit.
        outside : float
            Value outside the box.

        Returns
        -------
        (k,) or (k, s) float64
            Inside a ball, the mean over its cage vertices.
        """
        columns = values.reshape(len(self.mesh.vertices), -1)
        means = np.zeros((len(self._vertices) - len(columns), columns.shape[1]))
        if len(means):
            means = ball_means(self.mesh, columns)
        at = np.concatenate([columns, means])
        tet, weights = self.find(points)
        # The first vertex of a tetrahedron that fills a ball is the centre: its value is the ball's.
        weights[tet >= len(self.mesh.tets)] = [1.0, 0.0, 0.0, 0.0]
        out: NDArray[np.float64] = np.einsum("kc,kcs->ks", weights, at[self.tets[tet]])
        out[tet < 0] = outside
        return np.asarray(out.reshape(len(points), *values.shape[1:]))


@compiled()
def _incidence(tets, count):  # type: ignore[no-untyped-def]
    """Tetrahedra of each vertex v: `incident[start[v]:start[v + 1]]`."""
    start = np.zeros(count + 1, dtype=np.int64)
    for t in range(len(tets)):
        for i in range(4):
            start[tets[t, i] + 1] += 1
    for v in range(count):
        start[v + 1] += start[v]
    incident = np.empty(start[count], dtype=np.int32)
    fill = start[:count].copy()
    for t in range(len(tets)):
        for i in range(4):
            v = tets[t, i]
            incident[fill[v]] = t
            fill[v] += 1
    return start, incident


@compiled()
def _coordinates(p, vertices, tet, out):  # type: ignore[no-untyped-def]
    """Fill out (4,) with the barycentric coordinates of p; return the index of the smallest."""
    a = vertices[tet[0]]
    b, c, d, q = vertices[tet[1]] - a, vertices[tet[2]] - a, vertices[tet[3]] - a, p - a
    six = _det(b, c, d)
    out[1] = _det(q, c, d) / six
    out[2] = _det(b, q, d) / six
    out[3] = _det(b, c, q) / six
    out[0] = 1.0 - out[1] - out[2] - out[3]
    return np.argmin(out)


@compiled()
def _det(a, b, c):  # type: ignore[no-untyped-def]
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])


@compiled()
def _walk(points, vertices, tets, nearest, start, incident):  # type: ignore[no-untyped-def]
    """Visibility walk from a vertex to each position; -1 where it gets nowhere."""
    found = np.full(len(points), -1, dtype=np.int64)
    weights = np.empty((len(points), 4))
    trial = np.empty(4)
    for k in range(len(points)):
        tet, best = incident[start[nearest[k]]], -LOOSE
        for _ in range(LONGEST_WALK):
            smallest = trial[_coordinates(points[k], vertices, tets[tet], trial)]
            if smallest > best:
                best = smallest
                found[k] = tet
                weights[k] = trial
            if smallest >= -SLACK:
                break
            # Through the facet that hides the position most; the next one where a crack lies behind it.
            other = -1
            while other < 0 and smallest < -SLACK:
                facet = np.argmin(trial)
                smallest = trial[facet]
                trial[facet] = 0.0
                if smallest < -SLACK:
                    other = _neighbour(tets, tet, facet, start, incident)
            if other < 0:
                break
            tet = other
    return found, weights


@compiled()
def _neighbour(tets, tet, opposite, start, incident):  # type: ignore[no-untyped-def]
    """Tetrahedron across the facet opposite to a local vertex, or -1."""
    a = tets[tet, (opposite + 1) & 3]
    b = tets[tet, (opposite + 2) & 3]
    c = tets[tet, (opposite + 3) & 3]
    for k in range(start[a], start[a + 1]):
        other = incident[k]
        if other != tet:
            shared = 0
            for i in range(4):
                if tets[other, i] in (b, c):
                    shared += 1
            if shared == 2:
                return other
    return -1


@compiled()
def _least_outside(points, vertices, tets):  # type: ignore[no-untyped-def]
    """Tetrahedron in which a position's smallest barycentric coordinate is greatest, by looking at all."""
    found = np.empty(len(points), dtype=np.int64)
    weights = np.empty((len(points), 4))
    trial = np.empty(4)
    for k in range(len(points)):
        best = -np.inf
        for tet in range(len(tets)):
            worst = _coordinates(points[k], vertices, tets[tet], trial)
            if trial[worst] > best:
                best = trial[worst]
                found[k] = tet
                weights[k] = trial
    return found, weights
