"""Normals and interior points of Open3D's clouds."""

from __future__ import annotations

import logging
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from face_plugin.adapters.open3d.cloud import is_empty, layer_of, points_of, select, set_normals
from face_plugin.execution import Execution
from face_plugin.filters import Interior, Normals
from face_plugin.params import Params
from face_plugin.sides.sensors import sensors_of

__all__ = ["estimate_normals", "remove_interior_points"]

log = logging.getLogger(__name__)


def estimate_normals(
    pcd: Any,
    search_param: Any = None,
    fast_normal_computation: bool | float = True,
    *,
    max_nn: int | None = None,
    radius: float | None = None,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    up: ArrayLike | None = None,
    params: Params | None = None,
    execution: Execution | None = None,
    sculpt: str | os.PathLike[str] | None = None,
) -> None:
    """Give the cloud outward normals, in place; they need no orientation afterwards.

    Unlike Open3D's own, it overwrites normals that the cloud has and does not take their signs, and it
    raises on NaN points and on fewer than four distinct ones. An empty cloud is left as it is, with a
    logged warning.

    Parameters
    ----------
    pcd : open3d.geometry.PointCloud or open3d.t.geometry.PointCloud
        Of a tensor cloud, dtype and device are kept.
    search_param, fast_normal_computation, max_nn, radius
        Those of ``PointCloud.estimate_normals`` in the two APIs; FaCE has no use for them and logs that.
    viewpoints, seen_from, up
        Where sensors stood, as in `face_plugin.estimate_normals`.
    params : Params, optional
    execution : Execution, optional
    sculpt : path, optional
        File of charges and cage points, as of ``face mesh --sculpt``.

    Raises
    ------
    TypeError
        `pcd` is no point cloud, or `params` no `Params`; the message says what to pass.
    ValueError
        Points that are not finite, or too few; or an edit is refused.

    Examples
    --------
    >>> import open3d
    >>> from face_plugin.shapes import sphere
    >>> pcd = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(sphere(300).points))
    >>> estimate_normals(pcd)
    >>> pcd.has_normals()
    True
    """
    given = {
        "search_param": search_param is not None,
        "fast_normal_computation": fast_normal_computation is not True,
        "max_nn": max_nn is not None,
        "radius": radius is not None,
    }
    if any(given.values()):
        log.debug("FaCE has no use for %s", ", ".join(name for name, is_given in given.items() if is_given))
    if is_empty(pcd):
        return
    settings = {"params": params, "execution": execution}
    layer = layer_of(pcd, sculpt, sensors_of(viewpoints, seen_from, up), settings)
    set_normals(pcd, Normals(params, execution=execution)(layer).normals)


def remove_interior_points(
    pcd: Any,
    alpha: float | str | None = None,
    *,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    up: ArrayLike | None = None,
    params: Params | None = None,
    execution: Execution | None = None,
    sculpt: str | os.PathLike[str] | None = None,
) -> tuple[Any, Any]:
    """Drop the points inside the object, and strays; colours, covariances and attributes follow those that are kept.

    Parameters
    ----------
    pcd : open3d.geometry.PointCloud or open3d.t.geometry.PointCloud
        Stays as it is.
    alpha : float or {"auto", "dense", "sparse"}, optional
        Field strength below which space counts as inside, as in `Params`.
    viewpoints, seen_from, up, params, execution, sculpt
        As in `estimate_normals`.

    Returns
    -------
    pcd
        New cloud of the same type.
    index : list of int, or for a tensor cloud a Boolean mask
        The points kept, as ``remove_statistical_outlier`` and ``remove_statistical_outliers`` give them.

    Examples
    --------
    >>> import open3d
    >>> from face_plugin.shapes import sphere
    >>> pcd = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(sphere(300).points))
    >>> kept, index = remove_interior_points(pcd)
    >>> len(kept.points) == len(index)
    True
    """
    keep = np.ones(len(points_of(pcd)), dtype=np.bool_)
    if not is_empty(pcd):
        settings = {"params": params, "execution": execution}
        layer = layer_of(pcd, sculpt, sensors_of(viewpoints, seen_from, up), settings)
        keep = Interior(alpha, params, execution)(layer).keep
    return select(pcd, keep)
