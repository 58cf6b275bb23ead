"""Open3D scripts that run unchanged: its own method names call FaCE while installed."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from face_plugin.adapters.open3d.points import estimate_normals
from face_plugin.errors import require
from face_plugin.params import Params

__all__ = ["install", "installed", "uninstall"]

log = logging.getLogger(__name__)

_originals: dict[tuple[type, str], Any] = {}
_params: Params | None = None
_oriented: weakref.WeakSet[Any] = weakref.WeakSet()


def install(params: Params | None = None) -> None:
    """Make ``pcd.estimate_normals(...)`` of both Open3D APIs call FaCE, until `uninstall`.

    A following ``pcd.orient_normals_consistent_tangent_plane(k)`` of the same cloud does nothing, since its
    normals are consistent; of any other cloud it is Open3D's own. Installing again only changes `params`.

    Parameters
    ----------
    params : Params, optional
        Used by every call.

    Examples
    --------
    >>> import open3d
    >>> from face_plugin.shapes import sphere
    >>> pcd = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(sphere(300).points))
    >>> install()
    >>> pcd.estimate_normals()
    >>> pcd.orient_normals_consistent_tangent_plane(15)
    >>> uninstall()
    """
    global _params
    _params = params
    if _originals:
        return
    o3d = require("open3d", extra="open3d")
    for cloud in (o3d.geometry.PointCloud, o3d.t.geometry.PointCloud):
        tensor = cloud is o3d.t.geometry.PointCloud
        for name, make in (
            ("estimate_normals", _tensor_estimate if tensor else _legacy_estimate),
            ("orient_normals_consistent_tangent_plane", _orient),
        ):
            # From the class's own dictionary: what is put back there must be the same object.
            _originals[cloud, name] = cloud.__dict__[name]
            setattr(cloud, name, make(_originals[cloud, name]))


def uninstall() -> None:
    """Put Open3D's own methods back; nothing happens where they are in place."""
    global _params
    for (cloud, name), original in _originals.items():
        setattr(cloud, name, original)
    _originals.clear()
    _oriented.clear()
    _params = None


@contextmanager
def installed(params: Params | None = None) -> Iterator[None]:
    """`install` within a ``with`` block; afterwards all is as it was before, installed or not.

    Examples
    --------
    >>> import open3d
    >>> from face_plugin.shapes import sphere
    >>> pcd = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(sphere(300).points))
    >>> with installed():
    ...     pcd.estimate_normals()
    """
    before, was_installed = _params, bool(_originals)
    install(params)
    try:
        yield
    finally:
        if was_installed:
            install(before)
        else:
            uninstall()


def _estimate(pcd: Any, **arguments: Any) -> None:
    estimate_normals(pcd, **arguments, params=_params)
    _oriented.add(pcd)


def _legacy_estimate(original: Any) -> Callable[..., None]:
    def estimate_normals(self: Any, search_param: Any = None, fast_normal_computation: bool = True) -> None:
        _estimate(self, search_param=search_param, fast_normal_computation=fast_normal_computation)

    return _named_like(estimate_normals, original)


def _tensor_estimate(original: Any) -> Callable[..., None]:
    def estimate_normals(self: Any, max_nn: int | None = 30, radius: float | None = None) -> None:
        _estimate(self, max_nn=None if max_nn == 30 else max_nn, radius=radius)

    return _named_like(estimate_normals, original)


def _orient(original: Any) -> Callable[..., None]:
    def orient_normals_consistent_tangent_plane(
        self: Any, k: int, lambda_penalty: float = 0.0, cos_alpha_tol: float = 1.0
    ) -> None:
        if self in _oriented:
            log.debug("orient_normals_consistent_tangent_plane(%s) skipped: FaCE's normals are consistent", k)
        else:
            original(self, k, lambda_penalty, cos_alpha_tol)

    return _named_like(orient_normals_consistent_tangent_plane, original)


def _named_like(method: Callable[..., None], original: Any) -> Callable[..., None]:
    method.__doc__ = f"FaCE in place of the host's method, while installed.\n\n{original.__doc__}"
    return method
