"""Open3D's three functions that turn the signs of normals, by FaCE's knowledge of the sides."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin import estimate
from face_plugin.adapters.open3d.cloud import is_empty, normals_of, points_of, set_normals
from face_plugin.execution import Execution
from face_plugin.params import Params

__all__ = [
    "orient_normals_consistent_tangent_plane",
    "orient_normals_to_align_with_direction",
    "orient_normals_towards_camera_location",
]

log = logging.getLogger(__name__)


def orient_normals_consistent_tangent_plane(
    pcd: Any,
    k: int | None = None,
    lambda_penalty: float = 0.0,
    cos_alpha_tol: float = 1.0,
    *,
    params: Params | None = None,
    execution: Execution | None = None,
) -> None:
    """Turn the cloud's normals outward, in place; their lines stay as they are.

    Parameters
    ----------
    pcd : open3d.geometry.PointCloud or open3d.t.geometry.PointCloud
        With normals.
    k, lambda_penalty, cos_alpha_tol
        Those of Open3D's method; FaCE has no use for them and logs that.
    params : Params, optional
    execution : Execution, optional

    Raises
    ------
    TypeError
        `pcd` is no point cloud, or `params` no `Params`.
    RuntimeError
        The cloud has no normals, as of Open3D's own.
    ValueError
        Points or normals that are not finite, normals of length 0, or too few points.

    Examples
    --------
    >>> import open3d
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(300)
    >>> pcd = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(ball.points))
    >>> pcd.normals = open3d.utility.Vector3dVector(-ball.normals)
    >>> orient_normals_consistent_tangent_plane(pcd, 15)
    >>> bool((np.asarray(pcd.normals) == ball.normals).all())
    True
    """
    log.debug("FaCE has no use for k, lambda_penalty and cos_alpha_tol")
    _orient(pcd, params, execution)


def orient_normals_towards_camera_location(
    pcd: Any,
    camera_location: Any = (0.0, 0.0, 0.0),
    *,
    params: Params | None = None,
    execution: Execution | None = None,
) -> None:
    """Turn the cloud's normals to the side that a camera saw, in place; their lines stay as they are.

    Unlike Open3D's, it asks which points the camera saw: those hidden from it take the side of their sheet, such as
    the back of an object. A point counts as hidden where another one lies in front of it by three spacings or more.

    Parameters
    ----------
    pcd, params, execution
        As in `orient_normals_consistent_tangent_plane`, and so are the errors.
    camera_location : (3,) array_like or open3d.core.Tensor
        In the unit of the points. Also (k, 3), of several cameras.
    """
    _orient(pcd, params, execution, viewpoints=_array(camera_location))


def orient_normals_to_align_with_direction(
    pcd: Any,
    orientation_reference: Any = (0.0, 0.0, 1.0),
    *,
    params: Params | None = None,
    execution: Execution | None = None,
) -> None:
    """Turn the cloud's normals to the side from which it is seen from afar in a direction, in place.

    Unlike Open3D's, it asks which points are seen from there: those hidden, such as the underside of a roof, take the
    side of their sheet.

    Parameters
    ----------
    pcd, params, execution
        As in `orient_normals_consistent_tangent_plane`, and so are the errors.
    orientation_reference : (3,) array_like or open3d.core.Tensor
        Of any length.
    """
    _orient(pcd, params, execution, up=_array(orientation_reference))


def _orient(pcd: Any, params: Params | None, execution: Execution | None, **seen: Any) -> None:
    if not is_empty(pcd):
        oriented = estimate.orient_normals(points_of(pcd), normals_of(pcd), params, execution=execution, **seen)
        set_normals(pcd, oriented)


def _array(values: Any) -> NDArray[Any]:
    return np.asarray(values.cpu().numpy() if hasattr(values, "cpu") else values)
