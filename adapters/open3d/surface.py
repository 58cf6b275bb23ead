"""A surface from an Open3D point cloud."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from face_plugin.adapters.open3d.cloud import is_tensor, layer_of
from face_plugin.errors import require
from face_plugin.execution import Execution
from face_plugin.filters import Chain, Filter, Interior, Normals, Reconstruct
from face_plugin.params import Params
from face_plugin.sides.sensors import sensors_of
from face_plugin.trimming import TrimDistance

__all__ = ["create_from_point_cloud_face"]


def create_from_point_cloud_face(
    pcd: Any,
    depth: int = 8,
    *,
    screened: bool = True,
    filter_interior: bool = True,
    trim: float = 0.0,
    trim_distance: TrimDistance = "auto",
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    up: ArrayLike | None = None,
    params: Params | None = None,
    execution: Execution | None = None,
    sculpt: str | os.PathLike[str] | None = None,
) -> tuple[Any, Any]:
    """Reconstruct a surface as ``TriangleMesh.create_from_point_cloud_poisson`` does, needing no normals.

    Parameters
    ----------
    pcd : open3d.geometry.PointCloud or open3d.t.geometry.PointCloud
        Stays as it is; normals that it has are not used.
    depth, screened, filter_interior, trim, trim_distance, viewpoints, seen_from, up, params, execution
        As in `face_plugin.reconstruct`.
    sculpt : path, optional
        File of charges and cage points, as of ``face mesh --sculpt``.

    Returns
    -------
    mesh : open3d.geometry.TriangleMesh, or for a tensor cloud open3d.t.geometry.TriangleMesh
        With vertex normals, and with colours where the points have them: those of the nearest point kept.
    densities : open3d.utility.DoubleVector, or for a tensor cloud an open3d.core.Tensor (k,) of float64
        Sampling density at the vertices.

    Examples
    --------
    >>> import open3d
    >>> from face_plugin.shapes import sphere
    >>> pcd = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(sphere(300).points))
    >>> mesh, densities = create_from_point_cloud_face(pcd, depth=5)
    >>> mesh.is_edge_manifold(allow_boundary_edges=False)
    True
    """
    o3d = require("open3d", extra="open3d")
    middle: list[Filter] = [Interior()] if filter_interior else []
    last = Reconstruct(depth, screened, "open3d", trim, trim_distance)
    chain = Chain([Normals(params, execution=execution), *middle, last])
    settings = {"params": params, "execution": execution}
    layer = chain(layer_of(pcd, sculpt, sensors_of(viewpoints, seen_from, up), settings))
    surface = layer.surface
    assert surface is not None  # the chain ends with it
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(surface.vertices),
        o3d.utility.Vector3iVector(surface.faces.astype(np.int32)),
    )
    mesh.compute_vertex_normals()
    legacy = pcd.to_legacy() if is_tensor(pcd) else pcd
    if legacy.has_colors():
        nearest = cKDTree(layer.points[layer.keep]).query(surface.vertices)[1]
        mesh.vertex_colors = o3d.utility.Vector3dVector(np.asarray(legacy.colors)[layer.keep][nearest])
    if is_tensor(pcd):
        mesh = o3d.t.geometry.TriangleMesh.from_legacy(mesh, device=pcd.device)
        return mesh, o3d.core.Tensor(np.array(surface.densities), device=pcd.device)
    return mesh, o3d.utility.DoubleVector(surface.densities)
