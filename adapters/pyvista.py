"""PyVista: ``estimate_normals`` and ``reconstruct`` under ``dataset.face``, on every dataset with points.

Importing this module registers the accessor, where PyVista is installed and has accessors (version 0.48)::

    import face_plugin.adapters.pyvista
    import pyvista

    surface = pyvista.read("scan.ply").face.reconstruct(depth=9)
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from face_plugin.errors import MissingDependencyError, require
from face_plugin.estimate import reconstruct
from face_plugin.execution import Execution
from face_plugin.filters import Normals, PointSet
from face_plugin.params import Params
from face_plugin.sides.sensors import sensors_of

__all__ = ["FaceAccessor", "register", "unregister"]

log = logging.getLogger(__name__)

NAME = "face"


class FaceAccessor:
    """What stands behind ``dataset.face``.

    Parameters
    ----------
    dataset : pyvista.DataSet
        Its points are used; cells, if it has any, are not.

    Raises
    ------
    TypeError
        It is no dataset.

    Examples
    --------
    >>> import pyvista
    >>> from face_plugin.shapes import sphere
    >>> cloud = pyvista.PolyData(sphere(300).points)
    >>> FaceAccessor(cloud).estimate_normals().point_data.active_normals.shape
    (300, 3)
    """

    def __init__(self, dataset: Any) -> None:
        if not hasattr(dataset, "point_data"):
            hint = ": pass pyvista.PolyData(points)"
            raise TypeError(f"dataset must be a PyVista dataset, found {type(dataset).__name__}{hint}")
        self._dataset = dataset

    def estimate_normals(
        self,
        params: Params | None = None,
        *,
        inplace: bool = False,
        viewpoints: ArrayLike | None = None,
        seen_from: ArrayLike | None = None,
        up: ArrayLike | None = None,
        execution: Execution | None = None,
    ) -> Any:
        """Give the points outward unit normals, as the active normals, named "Normals" as PyVista's own.

        Parameters
        ----------
        params : Params, optional
        inplace : bool
            Change the dataset, or return a copy, as PyVista's filters do.
        viewpoints, seen_from, up
            Where sensors stood, as in `face_plugin.estimate_normals`.
        execution : Execution, optional

        Returns
        -------
        pyvista.DataSet
            Of the same type; the dataset itself with `inplace`.

        Raises
        ------
        ValueError
            Points that are not finite, or fewer than four distinct ones.
        """
        result = self._dataset if inplace else self._dataset.copy()
        layer = PointSet(np.asarray(result.points), sensors=sensors_of(viewpoints, seen_from, up))
        normals = Normals(params, execution=execution)(layer).normals
        result.point_data["Normals"] = np.array(normals)
        result.point_data.active_normals_name = "Normals"
        return result

    def reconstruct(self, params: Params | None = None, **options: Any) -> Any:
        """Reconstruct the surface of the points.

        Parameters
        ----------
        params : Params, optional
        **options
            Those of `face_plugin.reconstruct`, such as depth, filter_interior, viewpoints, up.

        Returns
        -------
        pyvista.PolyData
            With the point data "densities" where the host that reconstructs gives them.
        """
        pyvista = require("pyvista", extra="pyvista")
        surface = reconstruct(np.asarray(self._dataset.points), params, **options)
        mesh = pyvista.PolyData.from_regular_faces(surface.vertices, surface.faces)
        if surface.densities is not None:
            mesh.point_data["densities"] = surface.densities
        return mesh


def register() -> bool:
    """Register the accessor, and tell whether it is there: it is not where PyVista is missing or too old."""
    try:
        pyvista = require("pyvista", extra="pyvista")
    except MissingDependencyError:
        return False
    if not hasattr(pyvista, "register_dataset_accessor"):
        log.info("PyVista %s has no dataset accessors: FaceAccessor(dataset) serves", pyvista.__version__)
        return False
    # Not getattr: while it registers entry points, PyVista 0.49 would look this one up again, and find none.
    if NAME not in vars(pyvista.DataSet):
        pyvista.register_dataset_accessor(NAME, pyvista.DataSet)(FaceAccessor)
    return True


def unregister() -> None:
    """Undo `register`; nothing happens where it did nothing."""
    try:
        pyvista = require("pyvista", extra="pyvista")
    except MissingDependencyError:
        return
    if NAME in vars(pyvista.DataSet):
        pyvista.unregister_dataset_accessor(NAME, pyvista.DataSet)


register()
