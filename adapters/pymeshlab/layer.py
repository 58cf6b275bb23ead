"""The current layer of a MeshSet: its arrays, and writing values of our own back into it."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import require

__all__ = ["add_surface", "current_points", "write_normals", "write_scalar", "write_selection"]

_fresh = itertools.count()


def current_points(ms: Any, name: str, *, transformed: bool = False, onselected: bool = False) -> NDArray[np.float64]:
    """Vertices (n, 3) of the current layer, in its own coordinates or the scene's.

    Raises
    ------
    TypeError
        `ms` is no MeshSet.
    PyMeshLabException
        There is no layer, or nothing is selected in it where only the selection is to change.
    """
    ml = require("pymeshlab", extra="pymeshlab")
    if not isinstance(ms, ml.MeshSet):
        hint = ": pass a pymeshlab.MeshSet() after its add_mesh(mesh)"
        raise TypeError(f"ms must be a MeshSet, found {type(ms).__name__}{hint}")
    if ms.mesh_number() == 0:
        raise ml.PyMeshLabException(f"{name} requires at least one mesh loaded in the MeshSet.")
    mesh = ms.current_mesh()
    if onselected and mesh.selected_vertex_number() == 0:
        raise ml.PyMeshLabException(
            f"Failed to apply filter: {name}\nDetails: Cannot apply only on selection: there is no selection"
        )
    points: NDArray[np.float64] = mesh.transformed_vertex_matrix() if transformed else mesh.vertex_matrix()
    return points


def write_normals(ms: Any, normals: NDArray[Any], onselected: bool) -> None:
    """Write vertex normals (n, 3), to the bit, leaving all else of the layer as it is."""
    x, y, z = (_scratch(ms, normals[:, axis]) for axis in range(3))
    _evaluate(ms, "compute_normal_by_function_per_vertex", x=x, y=y, z=z, onselected=onselected)


def write_scalar(ms: Any, values: NDArray[Any], onselected: bool) -> None:
    """Write vertex scalars (n,), which MeshLab also calls quality."""
    _evaluate(ms, "compute_scalar_by_function_per_vertex", q=_scratch(ms, values), onselected=onselected)


def write_selection(ms: Any, selected: NDArray[np.bool_]) -> None:
    """Select these vertices (n,) and no other; selected faces stay."""
    condition = f"{_scratch(ms, selected)} > 0.5"
    _evaluate(ms, "compute_selection_by_condition_per_vertex", condselect=condition)


def add_surface(ms: Any, vertices: NDArray[np.float64], faces: NDArray[np.int64], label: str) -> None:
    """Add a layer with this mesh and make it current."""
    ml = require("pymeshlab", extra="pymeshlab")
    ms.add_mesh(ml.Mesh(vertex_matrix=vertices, face_matrix=faces.astype(np.int32)), label)


def _scratch(ms: Any, values: NDArray[Any]) -> str:
    """Put values into a new attribute of the layer and return its name.

    PyMeshLab has no call that sets the normals, scalars or selection of a mesh from an array, and none that
    changes or deletes an attribute. An expression over new scalar attributes is exact; a POINT attribute
    read as ``name_x`` gives wrong values on its first use. The attributes stay; no file holds them unless
    asked to.
    """
    ml = require("pymeshlab", extra="pymeshlab")
    column = np.ascontiguousarray(values, dtype=np.float64)
    while True:
        name = f"faraday_{next(_fresh)}"
        try:
            ms.current_mesh().add_vertex_custom_scalar_attribute(column, name)
        except ml.PyMeshLabException as error:
            if "already has" not in str(error):
                raise
        else:
            return name


def _evaluate(ms: Any, filter_name: str, **parameters: Any) -> None:
    try:
        ms.apply_filter(filter_name, **parameters)
    except RuntimeError as error:
        ml = require("pymeshlab", extra="pymeshlab")
        raise ml.PyMeshLabException(
            f"MeshLab's expressions do not work on this layer ({error}): a custom attribute of it may have a "
            "name that is no identifier (letters, digits and underscores, no digit first)"
        ) from error
