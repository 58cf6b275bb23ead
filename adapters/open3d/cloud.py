"""Open3D's two point cloud classes, to arrays and back."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import require

__all__ = ["is_empty", "is_tensor", "points_of", "select", "set_normals"]

log = logging.getLogger(__name__)


def is_tensor(pcd: Any) -> bool:
    """Tell a cloud of the tensor API from a legacy one."""
    return hasattr(pcd, "point")


def points_of(pcd: Any) -> NDArray[Any]:
    """Positions (n, 3) in the dtype of the cloud, without a copy where they are in the memory of the host."""
    if not is_tensor(pcd):
        return np.asarray(pcd.points)
    if "positions" not in pcd.point:
        return np.empty((0, 3))
    array: NDArray[Any] = pcd.point.positions.cpu().numpy()
    return array


def is_empty(pcd: Any) -> bool:
    """Whether there is nothing to do, which is worth a warning and no more: a script goes on."""
    if pcd.is_empty() or len(points_of(pcd)) == 0:
        log.warning("the point cloud is empty: nothing to do")
        return True
    return False


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
