"""trimesh: `PointCloud`, `Trimesh` (its vertices) and `Scene` wherever an array of points would do."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin import estimate
from face_plugin.cloud import as_points
from face_plugin.errors import require
from face_plugin.params import Params
from face_plugin.result import Result

__all__ = ["estimate_normals", "points_of", "reconstruct"]


def points_of(geometry: Any) -> NDArray[Any]:
    """Return the points of a `PointCloud`, the vertices of a `Trimesh`, those of a `Scene`, or an array as it is.

    A scene's are those of its geometries one after the other, in the order of ``scene.dump()``, in its own frame.

    Raises
    ------
    ValueError
        A scene without points.

    Examples
    --------
    >>> import trimesh
    >>> points_of(trimesh.creation.box()).shape
    (8, 3)
    """
    if hasattr(geometry, "dump") and hasattr(geometry, "graph"):
        parts = [np.asarray(part.vertices) for part in geometry.dump() if hasattr(part, "vertices")]
        if not parts:
            raise ValueError("the scene must hold a geometry with points, found none")
        return np.concatenate(parts)
    return np.asarray(getattr(geometry, "vertices", geometry))


def estimate_normals(geometry: Any, params: Params | None = None, **options: Any) -> Result:
    """`face_plugin.estimate_normals` of a geometry, which stays as it is.

    Parameters
    ----------
    geometry : trimesh.PointCloud, trimesh.Trimesh, trimesh.Scene or (n, 3) array_like
    params : Params, optional
    **options
        As in `face_plugin.estimate_normals`.

    Examples
    --------
    >>> import trimesh
    >>> from face_plugin.shapes import sphere
    >>> estimate_normals(trimesh.PointCloud(sphere(300).points)).normals.shape
    (300, 3)
    """
    # A path of trimesh's is drawn in the plane: its vertices are no sample of a curve.
    return estimate.estimate_normals(as_points(points_of(geometry)), params, **options)


def reconstruct(geometry: Any, params: Params | None = None, **options: Any) -> Any:
    """`face_plugin.reconstruct` of a geometry, as a new `Trimesh`.

    Parameters
    ----------
    geometry : trimesh.PointCloud, trimesh.Trimesh, trimesh.Scene or (n, 3) array_like
    params : Params, optional
    **options
        As in `face_plugin.reconstruct`.

    Returns
    -------
    trimesh.Trimesh
        With the vertices as they were reconstructed: none are merged or dropped. The attribute
        ``densities`` of its ``vertex_attributes`` is there where the host that reconstructs gives it.

    Examples
    --------
    >>> import trimesh
    >>> from face_plugin.shapes import sphere
    >>> reconstruct(trimesh.PointCloud(sphere(300).points), depth=5).is_watertight
    True
    """
    trimesh = require("trimesh", extra="trimesh")
    surface = estimate.reconstruct(points_of(geometry), params, **options)
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    if surface.densities is not None:
        mesh.vertex_attributes["densities"] = surface.densities
    return mesh
