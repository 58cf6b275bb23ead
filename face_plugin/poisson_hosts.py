"""The Poisson reconstruction of each host, on arrays.

All run on one thread: with more, the order of summation, and so the surface, changes from run to run.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import MissingDependencyError, require
from face_plugin.trimming import Arrays

__all__ = ["by_open3d", "by_pymeshlab"]

# The hosts share state within a process: several reconstructions at once crash, PyMeshLab's more often than Open3D's.
_one_at_a_time = threading.Lock()


def by_open3d(
    points: NDArray[np.float64], normals: NDArray[np.float64], depth: int, weight: float, scale: float
) -> Arrays:
    """Reconstruct with Open3D: vertices (v, 3), faces (f, 3) and the density (v,) of points at each vertex.

    Parameters
    ----------
    points, normals : (n, 3) float64
        Of unit extent, about the origin.
    depth : int
    weight : float
        Of the points; 0 is the variant that is not screened.
    scale : float
        Side of the cube in which is reconstructed, in that of the points.

    Raises
    ------
    MissingDependencyError
        Open3D is not installed, or is older than 0.20, which takes no weight, and `weight` is 0.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> vertices, faces, density = by_open3d(ball.points, ball.normals, 5, 4.0, 1.1)
    >>> len(density) == len(vertices)
    True
    """
    o3d = require("open3d", extra="open3d")
    pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    pcd.normals = o3d.utility.Vector3dVector(normals)
    reconstruct = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson
    weights = "point_weight" in (reconstruct.__doc__ or "")
    if weight == 0 and not weights:
        raise MissingDependencyError(
            f"screened=False needs Open3D 0.20 or newer, found {o3d.__version__}: pip install 'open3d>=0.20', "
            "or take the backend 'pymeshlab'"
        )
    with _one_at_a_time:
        mesh, densities = reconstruct(
            pcd, depth=depth, scale=scale, n_threads=1, **({"point_weight": weight} if weights else {})
        )
    return (
        np.asarray(mesh.vertices).copy(),
        np.asarray(mesh.triangles).astype(np.int64),
        np.asarray(densities).copy(),
    )


def by_pymeshlab(
    points: NDArray[np.float64], normals: NDArray[np.float64], depth: int, weight: float, scale: float
) -> Arrays:
    """Reconstruct with PyMeshLab: vertices (v, 3) and faces (f, 3); there is no density.

    Parameters
    ----------
    points, normals, depth, weight, scale
        As of `by_open3d`.

    Raises
    ------
    MissingDependencyError
        PyMeshLab is not installed.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> by_pymeshlab(ball.points, ball.normals, 5, 4.0, 1.1)[1].shape[1]
    3
    """
    pymeshlab = require("pymeshlab", extra="pymeshlab")
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=points, v_normals_matrix=normals))
    with _one_at_a_time:
        meshes.generate_surface_reconstruction_screened_poisson(
            depth=depth, pointweight=weight, scale=scale, preclean=False, threads=1
        )
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64), None
