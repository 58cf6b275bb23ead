"""Open3D: point clouds of both its APIs, with the argument names and return values of its own functions.

A script gains consistent outward normals by one line, or by none under `install`::

    from face_plugin.adapters import open3d as face

    face.estimate_normals(pcd)                      # for pcd.estimate_normals(); pcd.orient_normals...(k)
    mesh, densities = face.create_from_point_cloud_face(pcd, depth=9)
"""

from face_plugin.adapters.open3d.install import install, installed, uninstall
from face_plugin.adapters.open3d.orient import (
    orient_normals_consistent_tangent_plane,
    orient_normals_to_align_with_direction,
    orient_normals_towards_camera_location,
)
from face_plugin.adapters.open3d.points import estimate_normals, remove_interior_points
from face_plugin.adapters.open3d.surface import create_from_point_cloud_face

__all__ = [
    "create_from_point_cloud_face",
    "estimate_normals",
    "install",
    "installed",
    "orient_normals_consistent_tangent_plane",
    "orient_normals_to_align_with_direction",
    "orient_normals_towards_camera_location",
    "remove_interior_points",
    "uninstall",
]
