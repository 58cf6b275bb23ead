"""A sculpt as a file: JSON with charges and cage points in the coordinates of the input.

::

    {
      "version": 1,
      "charges": [[0.0, 0.0, 0.7]],
      "cage_points": [{"position": [1.0, 0.0, 0.2], "radius": 0.15}]
    }

Both lists may be left out; ``radius`` may be left out or null, and then follows from the points.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from face_plugin.io.cloudfile import replacing
from face_plugin.sculpt.sculptor import Edit

__all__ = ["CagePoint", "SculptFile"]

VERSION = 1
Position = tuple[float, float, float]


@dataclass(frozen=True)
class CagePoint:
    """A place to shield."""

    position: Position
    """In the coordinates of the input."""
    radius: float | None = None
    """Reach in the unit of the input; None = 0.9 x the distance to the nearest input point."""


@dataclass(frozen=True)
class SculptFile:
    """Charges and cage points, independent of any mesh.

    Examples
    --------
    >>> import tempfile
    >>> path = tempfile.mkdtemp() + "/edits.json"
    >>> SculptFile(charges=((0.0, 0.0, 0.7),)).save(path)
    >>> SculptFile.load(path).charges
    ((0.0, 0.0, 0.7),)
    """

    charges: tuple[Position, ...] = ()
    cage_points: tuple[CagePoint, ...] = ()

    @classmethod
    def of(cls, edits: Iterable[Edit]) -> SculptFile:
        """Return the edits of a cage: charges where they went to, so that they go there again."""
        charges, cage_points = [], []
        for edit in edits:
            if edit.kind == "charge":
                charges.append(_triple(edit.places[0].tolist()))
            else:
                cage_points.append(CagePoint(_triple(edit.position.tolist()), edit.radius))
        return cls(tuple(charges), tuple(cage_points))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> SculptFile:
        """Read a file.

        Raises
        ------
        ValueError
            The file is not what this module describes; the message names the file, the field and what was
            found.
        OSError
            The file cannot be read.
        """
        path = Path(path)
        try:
            content = json.loads(path.read_bytes().decode("utf-8-sig"), object_pairs_hook=_once)
            return cls._from_json(content)
        except (ValueError, RecursionError) as error:  # of what is not JSON or not UTF-8, or is nested without end
            raise ValueError(f"{path}: {error}") from error

    @classmethod
    def _from_json(cls, content: Any) -> SculptFile:
        table = _table("the file", content, required={"version"}, optional={"charges", "cage_points"})
        if isinstance(table["version"], bool) or table["version"] != VERSION:
            raise ValueError(f"version must be {VERSION}, found {table['version']!r}")
        given = enumerate(_list("charges", table.get("charges", [])))
        charges = [_position(f"charges[{row}]", item) for row, item in given]
        cage_points = []
        for row, item in enumerate(_list("cage_points", table.get("cage_points", []))):
            name = f"cage_points[{row}]"
            point = _table(name, item, required={"position"}, optional={"radius"})
            radius = point.get("radius")
            if radius is not None and not (_is_number(radius) and radius > 0):
                raise ValueError(f"{name}.radius must be a finite number > 0 or null, found {radius!r}")
            position = _position(f"{name}.position", point["position"])
            cage_points.append(CagePoint(position, None if radius is None else float(radius)))
        return cls(tuple(charges), tuple(cage_points))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file; one that stands there already is replaced at once, or not at all."""
        content = {
            "version": VERSION,
            "charges": [list(position) for position in self.charges],
            "cage_points": [{"position": list(p.position), "radius": p.radius} for p in self.cage_points],
        }
        text = json.dumps(content, indent=2, allow_nan=False) + "\n"
        with replacing(Path(path)) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make a dictionary; a key that occurs twice leaves open which value is meant."""
    table = dict(pairs)
    if len(table) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"the field {next(n for n in names if names.count(n) > 1)!r} occurs twice")
    return table


def _table(name: str, value: Any, *, required: set[str], optional: set[str]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{name} must be an object, found {value!r}")
    if missing := sorted(required - value.keys()):
        raise ValueError(f"{name}: the field {missing[0]!r} is missing")
    if unknown := sorted(value.keys() - required - optional):
        allowed = ", ".join(sorted(required | optional))
        raise ValueError(f"{name}: unknown field {unknown[0]!r}; allowed are {allowed}")
    return value


def _list(name: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{name} must be a list, found {value!r}")
    return value


def _is_number(value: Any) -> bool:
    """Tell finite numbers from all else; JSON's true is a Python int, and an int may exceed every float."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _position(name: str, value: Any) -> Position:
    if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
        raise ValueError(f"{name} must be three finite numbers, found {value!r}")
    return _triple(value)


def _triple(values: list[float]) -> Position:
    x, y, z = values
    return float(x), float(y), float(z)
