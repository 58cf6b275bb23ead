"""Parameters of a filter as MeshLab has them: typed, checked as PyMeshLab checks, written into scripts."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from face_plugin.errors import require
from face_plugin.params import CHOICES, Params

__all__ = ["Parameter", "common_parameters", "params_of"]

Kind = Literal["bool", "int", "float", "enum", "length"]
TYPES: dict[str, str] = {
    "bool": "RichBool",
    "int": "RichInt",
    "float": "RichFloat",
    "enum": "RichEnum",
    "length": "RichAbsPerc",
}
# MeshLab's numbers cannot be None or a word: in these, 0 stands for "derived from the data".
AUTOMATIC = {"alpha": "auto", "cage_spacing": None}


@dataclass(frozen=True)
class Parameter:
    """One parameter of a filter."""

    name: str
    kind: Kind
    default: Any
    """Of a length, in the unit of the layer; of an enum, one of `choices`."""
    text: str = ""
    choices: tuple[str, ...] = ()

    def cast(self, value: Any, diagonal: float) -> Any:
        """Value of a keyword argument, or what PyMeshLab raises for one of the wrong type."""
        ml = require("pymeshlab", extra="pymeshlab")
        if self.kind == "length":
            if isinstance(value, ml.PercentageValue):
                return value.value() / 100.0 * diagonal
            if isinstance(value, ml.PureValue):
                return value.value()
            raise ml.PyMeshLabException(
                f"Parameter {self.name}: must be a pymeshlab.PercentageValue object or a pymeshlab.PureValue "
                "object. Other type values are not accepted."
            )
        if self.kind == "enum" and isinstance(value, str):
            if value not in self.choices:
                allowed = "; ".join(map(repr, self.choices))
                raise ml.InvalidEnumException(f"Enum '{value}' not found. Possible values are {allowed}; ")
            return value
        try:
            if self.kind == "float" and not isinstance(value, str):
                return float(value)
            if self.kind == "bool" and not isinstance(value, str):
                return bool(value)
            index = operator.index(value)
        except (TypeError, ValueError):
            raise RuntimeError(
                f"Parameter {self.name}: unable to cast Python instance of type {type(value)} to {self.kind}"
            ) from None
        if self.kind == "enum":
            if not 0 <= index < len(self.choices):
                raise ml.InvalidEnumException(
                    f"Enum {index} not valid. Must be a value between 0 and {len(self.choices)}"
                )
            return self.choices[index]
        return index

    def read(self, text: str) -> Any:
        """Value of a ``Param`` of a script."""
        if self.kind == "bool" and text in ("true", "false"):
            return text == "true"
        try:
            if self.kind in ("float", "length"):
                return float(text)
            if self.kind == "enum":
                return self.choices[range(len(self.choices))[int(text)]]
            if self.kind == "int":
                return int(text)
        except (ValueError, IndexError):
            pass
        raise ValueError(f"parameter {self.name}: {text!r} is no {self.kind}")

    def write(self, value: Any, diagonal: float) -> dict[str, str]:
        """Attributes of a ``Param`` of a script, with those that MeshLab itself writes for the type."""
        result = {"type": TYPES[self.kind], "name": self.name, "value": str(value)}
        if self.kind == "bool":
            result["value"] = str(value).lower()
        elif self.kind == "length":
            result |= {"min": "0", "max": f"{diagonal:g}"}
        elif self.kind == "enum":
            result |= {"value": str(self.choices.index(value)), "enum_cardinality": str(len(self.choices))}
            result |= {f"enum_val{number}": choice for number, choice in enumerate(self.choices)}
        return result | {"description": self.name.replace("_", " ").capitalize(), "tooltip": self.text}


def common_parameters() -> tuple[Parameter, ...]:
    """Return the settings of `Params`, under their own names."""
    found = []
    for field in dataclasses.fields(Params):
        name, default = field.name, field.default
        if name == "alpha":
            text = "Field strength below which space counts as inside; 0 = automatic"
            found.append(Parameter(name, "float", 0.0, text))
        elif name == "cage_spacing":
            text = "Smallest distance between two balls; 0 = automatic"
            found.append(Parameter(name, "length", 0.0, text))
        elif name in CHOICES:
            found.append(Parameter(name, "enum", default, choices=CHOICES[name]))
        elif isinstance(default, (bool, int, float)):
            kinds: dict[type, Kind] = {bool: "bool", int: "int", float: "float"}
            found.append(Parameter(name, kinds[type(default)], default))
    return tuple(found)


def params_of(values: Mapping[str, Any]) -> Params:
    """Make the `Params` of the values of a filter's parameters."""
    known = {field.name for field in dataclasses.fields(Params)} & values.keys()
    settings: dict[str, Any] = {name: values[name] for name in known}
    settings |= {name: word for name, word in AUTOMATIC.items() if values[name] == 0}
    return Params(**settings)
