"""Open3D scripts that run unchanged: its own method names call FaCE while installed."""

from __future__ import annotations

import functools
import hashlib
import logging
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from face_plugin.adapters.open3d import orient
from face_plugin.adapters.open3d.cloud import normals_of, points_of
from face_plugin.adapters.open3d.points import estimate_normals
from face_plugin.errors import require
from face_plugin.execution import Execution
from face_plugin.params import Params, settled

__all__ = ["install", "installed", "uninstall"]

log = logging.getLogger(__name__)

_originals: dict[tuple[type, str], Any] = {}
# What every call is given: `params` and `execution`.
_settings: dict[str, Any] = {}
# Clouds whose normals point outward already, and what their points and normals were then.
_outward: weakref.WeakKeyDictionary[Any, bytes] = weakref.WeakKeyDictionary()


def install(params: Params | None = None, execution: Execution | None = None) -> None:
    """Make Open3D's methods for normals call FaCE, of both its APIs, until `uninstall`.

    These are ``estimate_normals``, ``orient_normals_consistent_tangent_plane``,
    ``orient_normals_towards_camera_location`` and ``orient_normals_to_align_with_direction``. The second does nothing
    to normals that FaCE has just estimated, since they are consistent. Installing again only changes the settings.

    Parameters
    ----------
    params : Params, optional
        Used by every call.
    execution : Execution, optional
        Likewise.

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
    _settings.update(zip(("params", "execution"), settled(params, execution), strict=True))
    if _originals:
        return
    o3d = require("open3d", extra="open3d")
    for cloud, estimate in ((o3d.geometry.PointCloud, _legacy_estimate), (o3d.t.geometry.PointCloud, _tensor_estimate)):
        for name, method in (
            ("estimate_normals", estimate),
            ("orient_normals_consistent_tangent_plane", _consistent),
            ("orient_normals_towards_camera_location", _towards),
            ("orient_normals_to_align_with_direction", _align),
        ):
            # From the class's own dictionary: what is put back there must be the same object.
            original = _originals[cloud, name] = cloud.__dict__[name]
            setattr(cloud, name, _in_place_of(original, name, method))


def uninstall() -> None:
    """Put Open3D's own methods back; nothing happens where they are in place."""
    for (cloud, name), original in _originals.items():
        setattr(cloud, name, original)
    _originals.clear()
    _outward.clear()
    _settings.clear()


@contextmanager
def installed(params: Params | None = None, execution: Execution | None = None) -> Iterator[None]:
    """`install` within a ``with`` block; afterwards all is as it was before, installed or not.

    Examples
    --------
    >>> import open3d
    >>> from face_plugin.shapes import sphere
    >>> pcd = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(sphere(300).points))
    >>> with installed():
    ...     pcd.estimate_normals()
    """
    before, was_installed = dict(_settings), bool(_originals)
    install(params, execution)
    try:
        yield
    finally:
        if was_installed:
            install(**before)
        else:
            uninstall()


def _estimate(pcd: Any, **arguments: Any) -> None:
    estimate_normals(pcd, **arguments, **_settings)
    if len(points_of(pcd)):
        _outward[pcd] = _digest(pcd)


def _legacy_estimate(self: Any, search_param: Any = None, fast_normal_computation: bool = True) -> None:
    _estimate(self, search_param=search_param, fast_normal_computation=fast_normal_computation)


def _tensor_estimate(self: Any, max_nn: int | None = 30, radius: float | None = None) -> None:
    _estimate(self, max_nn=None if max_nn == 30 else max_nn, radius=radius)


def _consistent(self: Any, k: int, lambda_penalty: float = 0.0, cos_alpha_tol: float = 1.0) -> None:
    if self in _outward and _outward[self] == _digest(self):
        log.debug("orient_normals_consistent_tangent_plane(%s) skipped: FaCE's normals are consistent", k)
    else:
        orient.orient_normals_consistent_tangent_plane(self, k, lambda_penalty, cos_alpha_tol, **_settings)


def _towards(self: Any, camera_location: Any = (0.0, 0.0, 0.0)) -> None:
    orient.orient_normals_towards_camera_location(self, camera_location, **_settings)


def _align(self: Any, orientation_reference: Any = (0.0, 0.0, 1.0)) -> None:
    orient.orient_normals_to_align_with_direction(self, orientation_reference, **_settings)


def _digest(pcd: Any) -> bytes:
    """Fingerprint of the points and normals, which a script may change in between."""
    digest = hashlib.blake2b(np.ascontiguousarray(points_of(pcd)).data)
    digest.update(np.ascontiguousarray(normals_of(pcd)).data)
    return digest.digest()


def _in_place_of(original: Any, name: str, method: Callable[..., None]) -> Callable[..., None]:
    @functools.wraps(method)
    def replacement(*args: Any, **kwargs: Any) -> None:
        method(*args, **kwargs)

    replacement.__name__ = name
    replacement.__doc__ = f"FaCE in place of the host's method, while installed.\n\n{original.__doc__}"
    return replacement
