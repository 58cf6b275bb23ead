"""Several steps in a row, and their file."""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from face_plugin.errors import FaceError
from face_plugin.filters.base import Filter
from face_plugin.filters.interior import Interior
from face_plugin.filters.normals import Normals, with_sensors
from face_plugin.filters.pointset import PointSet
from face_plugin.filters.reconstruct import Reconstruct
from face_plugin.filters.sculpt import Sculpt
from face_plugin.filters.thin import Thin
from face_plugin.io.cloudfile import replacing
from face_plugin.stages import Progress

__all__ = ["FILTERS", "Chain"]

FILTERS: dict[str, type[Filter]] = {step.name: step for step in (Normals, Interior, Thin, Sculpt, Reconstruct)}
"""The steps that a file may name."""


@dataclass(frozen=True)
class Chain(Filter):
    """Steps that run one after the other; a chain is a step itself.

    Parameters
    ----------
    steps : sequence of Filter

    Examples
    --------
    >>> from face_plugin.filters import Interior, Normals, PointSet
    >>> from face_plugin.shapes import nested_box
    >>> shape = nested_box(600)
    >>> layer = Chain([Normals(), Interior()])(PointSet(shape.points))
    >>> layer.normals.shape
    (600, 3)
    """

    name: ClassVar[str] = "chain"
    steps: Sequence[Filter] = ()

    def __post_init__(self) -> None:
        flat: list[Filter] = []
        for step in self.steps:
            flat.extend(step.steps if isinstance(step, Chain) else [step])
        object.__setattr__(self, "steps", tuple(flat))

    def __call__(self, layer: PointSet, *, progress: Progress | None = None) -> PointSet:
        """Run the steps; what goes wrong names the step it went wrong in.

        Raises
        ------
        ValueError, FaceError
            From a step, with its number (from 1) and name in front.
        """
        asked = layer.classify
        # Steps before the normals see the same sensors, and share their cage.
        said = [step.sensors for step in self.steps if isinstance(step, Normals) and step.sensors is not None]
        layer = with_sensors(layer, said[0] if said else None)
        for number, step in enumerate(self.steps, 1):
            ahead = any(isinstance(later, Interior) for later in self.steps[number - 1 :])
            try:
                layer = step(layer.replace(classify=asked or ahead), progress=progress)
            except (ValueError, FaceError) as error:
                raise type(error)(f"step {number} ({step.name}): {error}") from error
        return layer.replace(classify=asked)

    @classmethod
    def from_dict(cls, options: Mapping[str, Any]) -> Chain:
        """Make the chain from ``{"steps": [{"filter": name, option: value, ...}, ...]}``."""
        steps = options.get("steps")
        if options.keys() - {"steps", "filter"} or not isinstance(steps, list):
            found = ", ".join(sorted(options)) or "nothing"
            raise ValueError(f"a chain must hold a list named 'steps' and nothing else, found {found}")
        made: list[Filter] = []
        for number, item in enumerate(steps, 1):
            if not isinstance(item, Mapping) or not isinstance(item.get("filter"), str):
                raise ValueError(f"step {number}: must be a table with the key 'filter', found {item!r}")
            name = item["filter"]
            if name not in FILTERS:
                raise ValueError(f"step {number}: unknown filter {name!r}; allowed are {', '.join(FILTERS)}")
            try:
                made.append(FILTERS[name].from_dict({k: v for k, v in item.items() if k != "filter"}))
            except (ValueError, TypeError) as error:
                raise ValueError(f"step {number} ({name}): {error}") from error
        return cls(made)

    def to_dict(self) -> dict[str, Any]:
        """Return the chain as `from_dict` takes it."""
        return {"steps": [step.to_dict() for step in self.steps]}

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Chain:
        """Read a chain from a .json or .toml file.

        Raises
        ------
        ValueError
            Another extension, a malformed file, or a step that cannot be; the message names file and step.

        Examples
        --------
        >>> import tempfile
        >>> path = tempfile.mkdtemp() + "/chain.toml"
        >>> Chain([Thin(0.01), Normals()]).save(path)
        >>> [step.name for step in Chain.load(path).steps]
        ['thin', 'normals']
        """
        path = Path(path)
        # The standard library reads TOML from Python 3.11 on; tomli is the same parser for 3.10.
        toml = "tomllib" if sys.version_info >= (3, 11) else "tomli"
        modules = {".json": "json", ".toml": toml}
        if path.suffix.lower() not in modules:
            raise ValueError(f"{path}: a chain must be a .json or .toml file")
        parser = importlib.import_module(modules[path.suffix.lower()])
        data = path.read_bytes()
        try:
            content = parser.loads(data.decode("utf-8-sig"))
            if not isinstance(content, dict):
                raise ValueError(f"must hold a table, found {type(content).__name__}")
            chain = cls.from_dict(content)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"{path}: {error}") from error
        # A chain and its sculpt lie side by side, wherever the chain is run from.
        return cls(
            [
                dataclasses.replace(step, file=str(path.parent / step.file)) if isinstance(step, Sculpt) else step
                for step in chain.steps
            ]
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the chain to a .json or .toml file, whole or not at all; `load` reads it back to an equal chain."""
        path = Path(path)
        if path.suffix.lower() == ".json":
            text = json.dumps(self.to_dict(), indent=2) + "\n"
        elif path.suffix.lower() == ".toml":
            # Strings, numbers and booleans are written alike in both formats.
            steps = self.to_dict()["steps"]
            tables = ["".join(f"{k} = {json.dumps(v)}\n" for k, v in step.items()) for step in steps]
            text = "\n".join(f"[[steps]]\n{table}" for table in tables)
        else:
            raise ValueError(f"{path}: a chain must be a .json or .toml file")
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
