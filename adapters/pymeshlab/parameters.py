"""Parameters of a filter as MeshLab has them: typed, checked as PyMeshLab checks, written into scripts."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_type_hints

import numpy as np

from face_plugin.adapters.pymeshlab.script import Element
from face_plugin.errors import require
from face_plugin.execution import Execution
from face_plugin.params import CHOICES, Params, settings_of

__all__ = ["Parameter", "common_parameters", "settings_in"]

Kind = Literal["bool", "int", "float", "str", "enum", "length", "position"]
TYPES: dict[str, str] = {
    "bool": "RichBool",
    "int": "RichInt",
    "float": "RichFloat",
    "str": "RichString",
    "enum": "RichEnum",
    "length": "RichAbsPerc",
    "position": "RichPosition",
}
CASTS: dict[str, Callable[[Any], Any]] = {
    "bool": bool,
    "int": operator.index,
    "float": float,
    "enum": operator.index,
}
LENGTHS = ("cage_spacing",)
AUTOMATIC = "0 = automatic"


@dataclass(frozen=True)
class Parameter:
    """One parameter of a filter."""

    name: str
    kind: Kind
    default: Any
    """Of a length or position, in the unit of the layer; of an enum, one of `choices`."""
    text: str = ""
    choices: tuple[str, ...] = ()

    def cast(self, value: Any, diagonal: float) -> Any:
        """Value of a keyword argument, or what PyMeshLab raises for one of the wrong type."""
        ml = require("pymeshlab", extra="pymeshlab")
        if isinstance(value, str) and value == "auto" and self.text == AUTOMATIC:
            return self.default
        if self.kind == "length":
            if isinstance(value, ml.PercentageValue):
                return value.value() / 100.0 * diagonal
            if isinstance(value, ml.PureValue):
                return value.value()
            raise ml.PyMeshLabException(
                f"Parameter {self.name}: must be a pymeshlab.PercentageValue object or a pymeshlab.PureValue "
                "object. Other type values are not accepted."
            )
        if self.kind == "position":
            # What MeshLab's own filters raise where it is none.
            array = np.asarray(value, dtype=np.float64)
            if array.shape != (3,) or not np.isfinite(array).all():
                raise ml.PyMeshLabException(f"Parameter {self.name}: must be 3 finite numbers, found {value!r}")
            return tuple(array.tolist())
        if isinstance(value, str) and self.kind == "str":
            return value
        if isinstance(value, str) and self.kind == "enum":
            if value not in self.choices:
                allowed = "; ".join(map(repr, self.choices))
                raise ml.InvalidEnumException(f"Enum '{value}' not found. Possible values are {allowed}; ")
            return value
        try:
            if isinstance(value, str) or self.kind == "str":
                raise TypeError
            number = CASTS[self.kind](value)
        except (TypeError, ValueError):
            raise RuntimeError(
                f"Parameter {self.name}: unable to cast Python instance of type {type(value)} to {self.kind}"
            ) from None
        if self.kind != "enum":
            return number
        if not 0 <= number < len(self.choices):
            allowed = f"between 0 and {len(self.choices)}"
            raise ml.InvalidEnumException(f"Enum {number} not valid. Must be a value {allowed}")
        return self.choices[number]

    def read(self, element: Element) -> Any:
        """Value of a ``Param`` of a script."""
        text = element.get("value", "")
        try:
            if self.kind == "position":
                text = ",".join(element.get(axis, "") for axis in "xyz")
                return tuple(float(word) for word in text.split(","))
            if self.kind == "bool":
                return {"true": True, "false": False}[text]
            if self.kind == "enum":
                return dict(enumerate(self.choices))[int(text)]
            if self.kind == "int":
                return int(text)
            return text if self.kind == "str" else float(text)
        except (ValueError, KeyError):
            raise ValueError(f"parameter {self.name}: {text!r} is no {self.kind}") from None

    def write(self, value: Any, diagonal: float) -> dict[str, str]:
        """Attributes of a ``Param`` of a script, with those that MeshLab itself writes for the type."""
        result = {"type": TYPES[self.kind], "name": self.name, "value": str(value)}
        if self.kind == "bool":
            result["value"] = str(value).lower()
        elif self.kind == "position":
            del result["value"]
            result |= {axis: str(number) for axis, number in zip("xyz", value, strict=True)}
        elif self.kind == "length":
            result |= {"min": "0", "max": f"{diagonal:g}"}
        elif self.kind == "enum":
            result |= {"value": str(self.choices.index(value)), "enum_cardinality": str(len(self.choices))}
            result |= {f"enum_val{number}": choice for number, choice in enumerate(self.choices)}
        return result | {"description": self.name.replace("_", " ").capitalize(), "tooltip": self.text}


def common_parameters() -> tuple[Parameter, ...]:
    """Return the settings of `Params` and `Execution`, under their own names."""
    found, hints = [], get_type_hints(Params) | get_type_hints(Execution)
    for field in (*dataclasses.fields(Params), *dataclasses.fields(Execution)):
        types = get_args(hints[field.name]) or (hints[field.name],)
        kind: Kind = "float" if float in types else "int" if int in types else "str"
        if field.name in CHOICES:
            found.append(Parameter(field.name, "enum", field.default, choices=CHOICES[field.name]))
        elif field.name in LENGTHS:
            found.append(Parameter(field.name, "length", 0.0, AUTOMATIC))
        elif kind != "str" and not isinstance(field.default, (int, float)):
            # MeshLab's numbers cannot be None or a word.
            found.append(Parameter(field.name, kind, 0, AUTOMATIC))
        else:
            found.append(Parameter(field.name, kind, field.default))
    return tuple(found)


def settings_in(values: Mapping[str, Any]) -> dict[str, Any]:
    """Make `params` and `execution` of the values of a filter's parameters."""
    given = {entry.name: values[entry.name] for entry in common_parameters() if entry.text != AUTOMATIC}
    numbers = {entry.name: values[entry.name] for entry in common_parameters() if entry.text == AUTOMATIC}
    return settings_of(given | {name: value for name, value in numbers.items() if value != 0})
