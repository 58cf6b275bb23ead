"""Running one of our filters on the current layer, by keywords or as a step of a script."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from face_plugin.adapters.pymeshlab import layer as layers
from face_plugin.adapters.pymeshlab.parameters import settings_in
from face_plugin.adapters.pymeshlab.script import Element, kept_script
from face_plugin.adapters.pymeshlab.table import FILTERS, Values
from face_plugin.errors import MeshingError, require
from face_plugin.filters import PointSet
from face_plugin.filters.sculpt import sculpted
from face_plugin.sides.sensors import sensors_of

__all__ = ["apply_by_name", "apply_step", "suggestion"]


def suggestion(name: str, known: Iterable[str]) -> str:
    """Say what a name that is not known was meant to be, or which there are.

    Examples
    --------
    >>> suggestion("viewpoint", ["viewpos", "alpha"])
    'Did you mean viewpos?'
    """
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1)
    return f"Did you mean {near[0]}?" if near else f"There are {', '.join(names)}."


def apply_by_name(ms: Any, name: str, kwargs: Values) -> None:
    """Run a filter on the current layer with keyword arguments, raising what PyMeshLab raises."""
    parameters = FILTERS[name].parameters

    def values_of(diagonal: float) -> dict[str, Any]:
        for key in kwargs:
            if key not in parameters:
                raise require("pymeshlab", extra="pymeshlab").PyMeshLabException(
                    f"Parameter {key} not found for filter {name}. {suggestion(key, parameters)}"
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
        values[key] = parameters[key].read(element)
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
            layer = PointSet(points, sensors=sensors_of(values["viewpos"]) if values["flipflag"] else None)
            entry.run(ms, sculpted(layer, values["sculpt"] or None, **settings_in(values)), values)
    except (ValueError, OSError, MeshingError, ml.PyMeshLabException) as error:
        raise ml.PyMeshLabException(f"Failed to apply filter: {name}\nDetails: {error}") from error
