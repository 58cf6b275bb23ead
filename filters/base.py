"""What a step is, and how one is written down."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

from face_plugin.execution import Execution
from face_plugin.filters.pointset import PointSet
from face_plugin.params import Params, settings_of
from face_plugin.stages import Progress

__all__ = ["Filter"]

Step = TypeVar("Step", bound="Filter")
SETTINGS: dict[str, Any] = {"params": Params, "execution": Execution}
"""Fields of a step whose own fields stand beside the step's in a file."""


@dataclass(frozen=True)
class Filter(ABC):
    """A step of a chain: a frozen dataclass of its settings, called with a `PointSet`.

    A step that solves a cage has the fields ``params`` and ``execution``; in a file the settings of `Params` and
    `Execution` stand beside its own.

    Examples
    --------
    >>> from face_plugin.filters import Normals
    >>> step = Normals.from_dict({"cage_spacing": 0.1})
    >>> step.params.cage_spacing, step.to_dict()
    (0.1, {'filter': 'normals', 'cage_spacing': 0.1})
    """

    name: ClassVar[str]
    """Name of the step in a file."""

    @abstractmethod
    def __call__(self, layer: PointSet, *, progress: Progress | None = None) -> PointSet:
        """Return the next state; `layer` stays as it is."""

    @classmethod
    def from_dict(cls: type[Step], options: Mapping[str, Any]) -> Step:
        """Make the step from plain values.

        Raises
        ------
        ValueError
            An option is unknown, missing, or out of range; the message names it.
        """
        own = {field.name: field for field in dataclasses.fields(cls) if field.name not in SETTINGS}
        kinds = [SETTINGS[field.name] for field in dataclasses.fields(cls) if field.name in SETTINGS]
        allowed = {*own, *(field.name for kind in kinds for field in dataclasses.fields(kind))}
        if unknown := sorted(options.keys() - allowed):
            raise ValueError(f"unknown option {unknown[0]!r}; allowed are {', '.join(sorted(allowed))}")
        for name, field in own.items():
            if field.default is dataclasses.MISSING and name not in options:
                raise ValueError(f"the option {name!r} is missing")
        settings = {name: value for name, value in options.items() if name not in own}
        arguments = {name: value for name, value in options.items() if name in own}
        return cls(**arguments, **settings_of(settings))

    def to_dict(self) -> dict[str, Any]:
        """Return the name of the step and the settings that differ from their defaults, as plain values."""
        result: dict[str, Any] = {"filter": self.name}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, (Params, Execution)):
                default = type(value)().to_dict()
                result |= {name: item for name, item in value.to_dict().items() if item != default[name]}
            elif value != field.default:
                result[field.name] = value
        return result
