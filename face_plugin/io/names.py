"""What the names of columns mean, whatever program gave them: coordinates, normals, colours."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np

from face_plugin.io.cloudfile import Array

__all__ = [
    "COLOUR",
    "NORMAL",
    "POINT",
    "are_bytes",
    "axes_of",
    "colour_bytes",
    "guess_names",
    "is_known",
    "is_time",
    "meanings",
    "with_colours",
]

POINT = ("x", "y", "z")
NORMAL = ("nx", "ny", "nz")
COLOUR = ("red", "green", "blue")

_SPELLINGS = {
    **{axis: axis for axis in POINT},
    **{f"{axis}coord": axis for axis in POINT},
    **{f"{axis}coordinate": axis for axis in POINT},
    **{f"{word}{axis}": axis for axis in POINT for word in ("pos", "position", "point", "coord", "vertex", "p")},
    **{f"points{k}": axis for k, axis in enumerate(POINT)},
    "easting": "x",
    "east": "x",
    "northing": "y",
    "north": "y",
    "height": "z",
    "elevation": "z",
    "elev": "z",
    "altitude": "z",
    "alt": "z",
    "rechtswert": "x",
    "hochwert": "y",
    "höhe": "z",
    "hoehe": "z",
    **{f"n{axis}": f"n{axis}" for axis in POINT},
    **{f"{word}{axis}": f"n{axis}" for axis in POINT for word in ("normal", "norm")},
    **{f"normals{k}": f"n{axis}" for k, axis in enumerate(POINT)},
    **{f"{axis}normal": f"n{axis}" for axis in POINT},
    **{
        spelling: colour
        for colour in COLOUR
        for spelling in (
            colour,
            colour[0],
            f"{colour[0]}f",
            *(
                f"{word}{part}"
                for word in ("color", "colour", "diffuse", "rgb", "scalarcolor")
                for part in (colour, colour[0])
            ),
        )
    },
    **{f"rgb{k}": colour for k, colour in enumerate(COLOUR)},
    **{f"{word}{k}": colour for k, colour in enumerate(COLOUR) for word in ("colors", "color", "colours", "colour")},
}
# Plain words go before roundabout ones: "x" before "easting", "z" before "height", "red" before "r".
_PLAIN = (*POINT, *NORMAL, *COLOUR)
_OTHERS = {"lon", "lat", "longitude", "latitude", "intensity", "classification", "label", "id", "alpha", "a", "i", "t"}
_TIME = re.compile(r"(gps|utc|adjusted|standard)?(time|timestamp|timeofday|sec|secs|seconds|epoch|date)")
_UNIT = re.compile(r"\s*[\[(][^\])]*[\])]\s*$")


def _spelled(name: str) -> str:
    """Lower case, without quotes, unit in brackets and what separates words."""
    return re.sub(r"[\s_.:\-]+", "", _UNIT.sub("", name.strip().strip("\"'").lower()))


def meanings(names: Iterable[str]) -> dict[str, str]:
    """Return which of the names stand for x, y, z, nx, ny, nz, red, green and blue: meaning -> name.

    Examples
    --------
    >>> meanings(["time", "Easting [m]", "northing", "HEIGHT", "R"])
    {'x': 'Easting [m]', 'y': 'northing', 'z': 'HEIGHT', 'red': 'R'}
    """
    found: dict[str, str] = {}
    names = list(names)
    for name in names:
        spelled = _spelled(name)
        meaning = _SPELLINGS.get(spelled)
        if meaning and (meaning not in found or (spelled in _PLAIN and _spelled(found[meaning]) not in _PLAIN)):
            found[meaning] = name
    survey = {_spelled(name): name for name in names}
    if not any(axis in found for axis in POINT[:2]) and {"e", "n"} <= set(survey):
        # Single letters mean little, unless they stand together.
        found.update({axis: survey[letter] for axis, letter in zip(POINT, "enh", strict=True) if letter in survey})
    return found


def axes_of(found: Mapping[str, str], *, rest: int = 0) -> tuple[str, ...]:
    """Return the axes of the points: x, y, z; x, y where there is no z, and no column that could be one.

    Normals nx, ny without nz are certain.

    Parameters
    ----------
    found : dict of str to str
        As `meanings` has it.
    rest : int
        Number of columns of numbers whose names mean nothing: one of them may be a height.

    Examples
    --------
    >>> axes_of(meanings(["x", "y", "nx", "ny"])), axes_of(meanings(["x", "y", "depth"]), rest=1)
    (('x', 'y'), ('x', 'y', 'z'))
    """
    flat = "nx" in found and "ny" in found and "nz" not in found
    plane = "x" in found and "y" in found and "z" not in found and (flat or not rest)
    return POINT[:2] if plane else POINT


def is_known(name: str) -> bool:
    """Whether a word is the usual name of a column."""
    return _spelled(name) in _SPELLINGS or _spelled(name) in _OTHERS or is_time(name)


def is_time(name: str) -> bool:
    """Whether a word is the usual name of a column of times, which are never coordinates."""
    return _TIME.fullmatch(_spelled(name)) is not None


def guess_names(table: list[Array], *, suffix: str = "") -> list[str]:
    """Name columns that have no names: x, y, z, then normals (unit length) and colours (bytes), then numbers.

    Two columns are points in the plane. Text before the first number is a label of the point. ``.pts`` files have an
    intensity before the colours, ``.xyzrgb`` files colours of 0 to 1.
    """
    labels = next((k for k, column in enumerate(table) if column.dtype.kind != "U"), 0)
    if labels:
        return [f"label_{k + 1}" for k in range(labels)] + guess_names(table[labels:], suffix=suffix)
    if len(table) == 2:
        return [*POINT[:2]]
    names = [*POINT]
    if _are_normals(table[3:6]):
        names += NORMAL
    rest = table[len(names) :]
    if suffix == ".pts" and (len(rest) == 1 or are_bytes(rest[1:4])):
        names.append("intensity")
        rest = rest[1:]
    if are_bytes(rest[:3]) or (suffix == ".xyzrgb" and len(rest) >= 3):
        names += COLOUR
    return names + [f"column_{k + 1}" for k in range(len(names), len(table))]


def _numbers(columns: list[Array]) -> bool:
    return len(columns) == 3 and all(column.dtype.kind in "fiu" for column in columns)


def _are_normals(columns: list[Array]) -> bool:
    """Colours of 0 to 1 have this length only by chance; zero stands for "no normal"."""
    if not _numbers(columns):
        return False
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.sqrt(sum(column.astype(np.float64) ** 2 for column in columns))
        return bool(np.all((np.abs(length - 1.0) < 1e-2) | (length == 0)) and np.any(length))


def are_bytes(columns: list[Array]) -> bool:
    """Whole numbers of 0 to 255, and not merely flags."""
    if not _numbers(columns) or not len(columns[0]):
        return False
    low = min(column.min() for column in columns)
    high = max(column.max() for column in columns)
    return bool(1 < high <= 255 and low >= 0 and all(np.all(c == np.rint(c)) for c in columns))


def colour_bytes(values: list[Array]) -> list[Array]:
    """Return colours as bytes: from 0 to 1, from 16 bits, or from bytes in a wider type.

    Parameters
    ----------
    values : list of (n,) arrays
        The channels; what one of them needs is done to all.
    """
    if all(channel.dtype == np.uint8 for channel in values):
        return values
    numbers = [np.nan_to_num(channel.astype(np.float64)) for channel in values]
    high = max((float(channel.max(initial=0)) for channel in numbers), default=0.0)
    if high > 255:
        numbers = [channel / 257.0 for channel in numbers]
    elif values[0].dtype.kind == "f" and high <= 1:
        numbers = [channel * 255.0 for channel in numbers]
    return [np.clip(np.rint(channel), 0, 255).astype(np.uint8) for channel in numbers]


def with_colours(attributes: Mapping[str, Array]) -> dict[str, Array]:
    """Return the attributes with colours under red, green and blue, as bytes, in the place of the red one.

    Examples
    --------
    >>> list(with_colours({"R": np.ones(2), "G": np.ones(2), "i": np.ones(2), "B": np.zeros(2)}))
    ['red', 'green', 'blue', 'i']
    """
    split: dict[str, Array] = {}
    for name, values in attributes.items():
        whole = _spelled(name) in ("rgb", "rgba", "color", "colour", "colors", "colours")
        if whole and values.ndim == 2 and values.shape[1] in (3, 4):
            split.update({channel: values[:, k] for k, channel in enumerate((*COLOUR, "alpha")[: values.shape[1]])})
        else:
            split[name] = values
    found = meanings(split)
    if not all(channel in found and split[found[channel]].dtype.kind in "fiu" for channel in COLOUR):
        return split
    names = [found[channel] for channel in COLOUR]
    channels = dict(zip(COLOUR, colour_bytes([split[name] for name in names]), strict=True))
    out: dict[str, Array] = {}
    for name, values in split.items():
        if name == names[0]:
            out.update(channels)
        elif name not in names and name not in COLOUR:
            out[name] = values
    return out
