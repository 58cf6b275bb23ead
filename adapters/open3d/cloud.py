"""Open3D's two point cloud classes, to arrays and back."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import require
from face_plugin.filters import PointSet
from face_plugin.filters.sculpt import sculpted
from face_plugin.sides.sensors import Sensors

__all__ = ["is_empty", "is_tensor", "layer_of", "normals_of", "points_of", "select", "set_normals"]

log = logging.getLogger(__name__)


def is_tensor(pcd: Any) -> bool:
    """Tell a cloud of the tensor API from a legacy one."""
    return hasattr(pcd, "point")


def points_of(pcd: Any) -> NDArray[Any]:
    """Positions (n, 3) in the dtype of the cloud, without a copy where they are in the memory of the host.

    Raises
    ------
    TypeError
        It is no point cloud; the message says how to make one.
    """
    if type(pcd).__name__ != "PointCloud":
        raise TypeError(f"pcd must be an Open3D PointCloud, found {type(pcd).__name__}{_remedy(pcd)}")
    if not is_tensor(pcd):
        return np.asarray(pcd.points)
    if "positions" not in pcd.point:
        return np.empty((0, 3))
    array: NDArray[Any] = pcd.point.positions.cpu().numpy()
    return array


def _remedy(found: Any) -> str:
    if isinstance(found, (np.ndarray, list, tuple)):
        return (
            ": pass open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points)), "
            "or the array to face_plugin.estimate_normals"
        )
    if type(found).__name__ == "TriangleMesh":
        return ": pass points of it, such as mesh.sample_points_poisson_disk(20000)"
    return ""


def normals_of(pcd: Any) -> NDArray[Any]:
    """Return the normals (n, 3) of the cloud, in its dtype.

    Raises
    ------
    RuntimeError
        It has none, as of Open3D's own.
    """
    has = "normals" in pcd.point if is_tensor(pcd) else pcd.has_normals()
    if not has:
        raise RuntimeError("No normals in the PointCloud. Call estimate_normals() first.")
    return np.asarray(pcd.point.normals.cpu().numpy() if is_tensor(pcd) else pcd.normals)


def is_empty(pcd: Any) -> bool:
    """Whether there is nothing to do, which is worth a warning and no more: a script goes on."""
    if len(points_of(pcd)) == 0:
        log.warning("the point cloud is empty: nothing to do")
        return True
    return False


def layer_of(
    pcd: Any, sculpt: str | os.PathLike[str] | None, sensors: Sensors | None, settings: Mapping[str, Any]
) -> PointSet:
    """Points of the cloud for a chain of steps, with the sensors and the edits of a sculpt file."""
    return sculpted(PointSet(points_of(pcd), sensors=sensors), sculpt, **settings)


def set_normals(pcd: Any, normals: NDArray[Any] | None) -> None:
    """Write normals (n, 3) into the cloud, on its device."""
    o3d = require("open3d", extra="open3d")
    array = np.array(normals)  # a copy: Open3D takes no read-only arrays
    if is_tensor(pcd):
        pcd.point.normals = o3d.core.Tensor(array, device=pcd.device)
    else:
        pcd.normals = o3d.utility.Vector3dVector(array)


def select(pcd: Any, keep: NDArray[np.bool_]) -> tuple[Any, Any]:
    """Copy the cloud with the kept points alone, and tell which: indices, or for a tensor cloud a mask."""
    if not is_tensor(pcd):
        index: list[int] = np.flatnonzero(keep).tolist()
        return pcd.select_by_index(index), index
    mask = require("open3d", extra="open3d").core.Tensor(np.array(keep), device=pcd.device)
    return pcd.select_by_mask(mask) if len(keep) else pcd.clone(), mask
