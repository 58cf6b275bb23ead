"""Values of the solved field anywhere in the box, in the plane: triangles are found by SciPy's Delaunay walk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from face_plugin.faraday.gradient import ball_means
from face_plugin.faraday.locate import Locator
from face_plugin.faraday.meshers import CageMesh

__all__ = ["AnyLocator", "PlaneLocator", "locator_of"]


class PlaneLocator:
    """Interpolates values given at the vertices of a mesh of triangles; as `face_plugin.faraday.locate.Locator`.

    The mesh is the Delaunay triangulation of its vertices without the triangles within discs; with these it has no
    holes.

    Parameters
    ----------
    mesh : CageMesh

    Examples
    --------
    >>> from face_plugin.shapes.curves import circle
    >>> from face_plugin.solver import FaCE
    >>> mesh = FaCE(circle(100).points).mesh
    >>> PlaneLocator(mesh).interpolate(np.array([[0.1, 0.2]]), mesh.vertices[:, 1]).round(12)
    array([0.2])
    """

    def __init__(self, mesh: CageMesh) -> None:
        self.mesh = mesh
        self._delaunay = Delaunay(mesh.vertices, qhull_options="Qbb Qc Qz Q12")

    def interpolate(
        self, points: NDArray[np.float64], values: NDArray[np.float64], *, outside: float = np.nan
    ) -> NDArray[np.float64]:
        """Interpolate values given at the vertices of the mesh.

        Parameters
        ----------
        points : (k, 2) float64, in the canonical frame
        values : (m,) or (m, s) float64
            Values at the vertices of the mesh, in any unit.
        outside : float
            Value outside the box.

        Returns
        -------
        (k,) or (k, s) float64
            Inside a disc, the mean over its vertices.
        """
        columns = values.reshape(len(self.mesh.vertices), -1)
        triangle = self._delaunay.find_simplex(points)
        corner = self._delaunay.simplices[triangle]
        transform = self._delaunay.transform[triangle]
        two = np.einsum("kij,kj->ki", transform[:, :2], points - transform[:, 2])
        weights = np.column_stack([two, 1.0 - two.sum(axis=1)])
        out = np.einsum("kc,kcs->ks", weights, columns[corner])
        owner = self.mesh.owner[corner]
        within = (owner[:, 0] >= 0) & (owner == owner[:, :1]).all(axis=1)
        if within.any():
            out[within] = ball_means(self.mesh, columns)[owner[within, 0]]
        out[triangle < 0] = outside
        return np.asarray(out.reshape(len(points), *values.shape[1:]))


AnyLocator = Locator | PlaneLocator


def locator_of(mesh: CageMesh) -> AnyLocator:
    """Interpolation in a mesh, of tetrahedra or of triangles."""
    return PlaneLocator(mesh) if mesh.vertices.shape[1] == 2 else Locator(mesh)
