"""What our filters do to a MeshSet, by name."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from face_plugin.adapters.pymeshlab import layer as layers
from face_plugin.adapters.pymeshlab.parameters import Parameter, common_parameters, params_of
from face_plugin.adapters.pymeshlab.script import Element, kept_script
from face_plugin.errors import MeshingError, require
from face_plugin.filters import Chain, Filter, Interior, Normals, PointSet, Surface
from face_plugin.filters.sculpt import sculpted

__all__ = ["FILTERS", "apply_by_name", "apply_step", "python_name"]

Values = Mapping[str, Any]


@dataclass(frozen=True)
class MeshLabFilter:
    """A filter with its parameters."""

    title: str
    """Name in MeshLab's menus and scripts; PyMeshLab's is the same in lower case with underscores."""
    run: Callable[[Any, PointSet, Values], None]
    own: tuple[Parameter, ...] = ()
    transformed: bool = False
    """Whether it works in the coordinates of the scene, as MeshLab's reconstructions do."""

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The filter's own parameters, and then those of the method."""
        return {parameter.name: parameter for parameter in (*self.own, _SCULPT, *common_parameters())}


def _normals(ms: Any, layer: PointSet, values: Values) -> None:
    normals = Normals(params_of(values))(layer).normals
    assert normals is not None  # the step gives them
    layers.write_normals(ms, normals, values["onselected"])


def _interior(ms: Any, layer: PointSet, values: Values) -> None:
    layers.write_selection(ms, Interior(params=params_of(values))(layer).attributes["interior"])


def _strength(ms: Any, layer: PointSet, values: Values) -> None:
    strength = Normals(params_of(values))(layer).attributes["strength"]
    layers.write_scalar(ms, strength, values["onselected"])


def _surface(ms: Any, layer: PointSet, values: Values) -> None:
    middle: list[Filter] = [Interior()] if values["filter_interior"] else []
    last = Surface(values["depth"], values["screened"], "pymeshlab")
    surface = Chain([Normals(params_of(values)), *middle, last])(layer).surface
    assert surface is not None  # the chain ends with it
    layers.add_surface(ms, surface.vertices, surface.faces, "Faraday mesh")


_SCULPT = Parameter("sculpt", "str", "", "File of charges and cage points (JSON); empty: none")
_ONSELECTED = Parameter("onselected", "bool", False, "Change the selected vertices only; all conduct")
_TABLE = (
    MeshLabFilter("Compute Normal by Faraday Cage", _normals, (_ONSELECTED,)),
    MeshLabFilter("Compute Selection by Faraday Interior", _interior),
    MeshLabFilter("Compute Scalar by Faraday Strength", _strength, (_ONSELECTED,)),
    MeshLabFilter(
        "Generate Surface Reconstruction Faraday",
        _surface,
        (
            Parameter("depth", "int", 8, "Depth of the octree of the reconstruction"),
            Parameter("screened", "bool", True, "Screened reconstruction, or the smoother unscreened one"),
            Parameter("filter_interior", "bool", True, "Leave out the points inside the object"),
        ),
        transformed=True,
    ),
)


def python_name(title: str) -> str:
    """Name of a filter in PyMeshLab from its name in MeshLab."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")


FILTERS = {python_name(entry.title): entry for entry in _TABLE}


def apply_by_name(ms: Any, name: str, kwargs: Values) -> None:
    """Run a filter on the current layer with keyword arguments, raising what PyMeshLab raises."""
    parameters = FILTERS[name].parameters

    def values_of(diagonal: float) -> dict[str, Any]:
        for key in kwargs:
            if key not in parameters:
                raise require("pymeshlab", extra="pymeshlab").PyMeshLabException(
                    f"Parameter {key} not found for filter {name}. Please check the documentation."
                )
        given = {key: parameters[key].cast(value, diagonal) for key, value in kwargs.items()}
        return {key: given.get(key, entry.default) for key, entry in parameters.items()}

    _apply(ms, name, values_of)


def apply_step(ms: Any, name: str, step: Element) -> None:
    """Run a filter on the current layer as a step of a script says.

    Raises
    ------
    ValueError
        A parameter is unknown, or its value of the wrong type.
    """
    parameters = FILTERS[name].parameters
    values = {key: entry.default for key, entry in parameters.items()}
    for element in step.findall("Param"):
        key = element.get("name", "")
        if key not in parameters:
            raise ValueError(f"unknown parameter {key!r}; allowed are {', '.join(parameters)}")
        values[key] = parameters[key].read(element.get("value", ""))
    _apply(ms, name, lambda diagonal: values)


def _apply(ms: Any, name: str, values_of: Callable[[float], dict[str, Any]]) -> None:
    """Run a filter and record it in the MeshSet's script; what goes wrong is worded as PyMeshLab does."""
    ml = require("pymeshlab", extra="pymeshlab")
    entry = FILTERS[name]
    points = layers.current_points(ms, name, transformed=entry.transformed)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    values = values_of(diagonal)
    if values.get("onselected"):
        layers.current_points(ms, name, onselected=True)
    step = Element("filter", name=entry.title)
    for key, parameter in entry.parameters.items():
        step.append(Element("Param", parameter.write(values[key], diagonal)))
    try:
        with kept_script(ms, step):
            entry.run(ms, sculpted(PointSet(points), values["sculpt"] or None, params_of(values)), values)
    except (ValueError, OSError, MeshingError, ml.PyMeshLabException) as error:
        raise ml.PyMeshLabException(f"Failed to apply filter: {name}\nDetails: {error}") from error
