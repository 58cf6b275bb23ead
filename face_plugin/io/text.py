"""Points in columns of text: XYZ, TXT, CSV, ASC, PTS; delimiter and column names are found out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, columns, format_column, interleave, malformed

_POINT = ("x", "y", "z")
_NORMAL = ("nx", "ny", "nz")
_ALIASES = {
    **{f"normal_{axis}": f"n{axis}" for axis in "xyz"},
    **{f"normal{axis}": f"n{axis}" for axis in "xyz"},
    **{f"n_{axis}": f"n{axis}" for axis in "xyz"},
}
_COMMENT = ("#", "//", ";;")


@dataclass(frozen=True)
class _Layout:
    """How the lines of a file look, so that it can be written alike."""

    delimiter: str | None
    head: tuple[str, ...]
    """Lines before the data as they stand, the one with the column names left out."""
    names: tuple[str, ...]
    """Name of each column, in the file's order."""
    header: str | None
    """What stands before the column names ('' or a comment sign), or None where the file has no names."""
    counted: bool
    """The first line is the number of points (PTS)."""


def read(path: Path) -> CloudFile:
    """Read a text file of points; see `face_plugin.io.read_cloud`."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise malformed(path, "text", f"not text: {error}") from error
    start, head = 0, []
    while start < len(lines) and (not lines[start].strip() or lines[start].lstrip().startswith(_COMMENT)):
        head.append(lines[start])
        start += 1
    counted = start + 1 < len(lines) and lines[start].strip().isdigit()
    start += counted
    if start == len(lines):
        raise malformed(path, "text", "no line with coordinates")
    delimiter = next((d for d in (",", ";", "\t") if d in lines[start]), None)
    first = _split(lines[start], delimiter)
    names, header = None, None
    if not _is_number(first[0]):
        names, header, start = first, "", start + 1
        if start == len(lines):
            raise malformed(path, "text", f"no line after the column names {first}")
        first = _split(lines[start], delimiter)
    elif head:
        sign = re.match(r"\s*(#+|//|;;)\s*", head[-1])
        commented = _split(head[-1][sign.end() :], delimiter) if sign else []
        if sign and len(commented) == len(first) and {"x", "y", "z"} <= {_plain(n) for n in commented}:
            names, header = commented, sign.group(0)
            head.pop()
    table = _parse(path, lines, start, delimiter, len(first))
    if names is None:
        names = _guess_names(table)
    elif len(names) != len(table):
        raise malformed(path, "text", f"{len(names)} column names for {len(table)} columns")
    plain = [_plain(name) for name in names]
    missing = [axis for axis in _POINT if axis not in plain]
    if missing or any(table[plain.index(axis)].dtype.kind not in "fiu" for axis in _POINT):
        raise malformed(path, "text", f"columns {list(names)}: no numbers under x, y, z")
    has_normals = all(n in plain and table[plain.index(n)].dtype.kind in "fiu" for n in _NORMAL)
    used = _POINT + (_NORMAL if has_normals else ())
    return CloudFile(
        points=np.stack([table[plain.index(n)].astype(np.float64) for n in _POINT], axis=1),
        normals=np.stack([table[plain.index(n)] for n in _NORMAL], axis=1) if has_normals else None,
        attributes={name: table[k] for k, name in enumerate(names) if plain[k] not in used},
        suffix=path.suffix.lower(),
        source=_Layout(delimiter, tuple(head), tuple(names), header, counted),
    )


def _split(line: str, delimiter: str | None) -> list[str]:
    return [word.strip() for word in line.strip().split(delimiter)]


def _plain(name: str) -> str:
    low = name.strip().strip('"').lower()
    return _ALIASES.get(low, low)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _parse(path: Path, lines: list[str], start: int, delimiter: str | None, width: int) -> list[Array]:
    """Parse the data lines into one array a column: integers, floats, or text."""
    if width < 3:
        raise malformed(
            path, "text", f"line {start + 1} has {width} columns ({lines[start][:60]!r}), expected 3 or more"
        )
    data = lines[start:]
    try:
        table = np.loadtxt(data, dtype=np.float64, delimiter=delimiter, ndmin=2, comments=None)
    except ValueError:
        rows = [(k, line) for k, line in enumerate(data, start + 1) if line.strip()]
        words = []
        for k, line in rows:
            row = _split(line, delimiter)
            if len(row) != width:
                raise malformed(
                    path, "text", f"line {k} has {len(row)} columns, line {start + 1} has {width}"
                ) from None
            words.append(row)
        return [_column(path, [row[c] for row in words], [k for k, _ in rows]) for c in range(width)]
    first = _split(lines[start], delimiter)
    return [_narrow(table[:, c], first[c], data, delimiter, c) for c in range(width)]


def _column(path: Path, words: list[str], numbers: list[int]) -> Array:
    """Turn one column into numbers, or keep it as text where none of it is one."""
    try:
        return np.array(words, dtype=np.float64)
    except ValueError:
        if not _is_number(words[0]):
            return np.array(words)
        k = next(k for k, word in enumerate(words) if not _is_number(word))
        raise malformed(path, "text", f"line {numbers[k]}: {words[k][:40]!r} is not a number") from None


def _narrow(values: Array, first: str, data: list[str], delimiter: str | None, column: int) -> Array:
    """Turn whole numbers back into integers, so that a label 3 is not written as 3.0."""
    if (
        not first.lstrip("+-").isdigit()
        or not np.all(np.isfinite(values))
        or np.any(values != np.rint(values))
    ):
        return values
    if np.abs(values).max() < 2.0**53:
        return values.astype(np.int64)
    try:
        return np.loadtxt(data, dtype=np.int64, delimiter=delimiter, usecols=column, ndmin=1, comments=None)
    except (ValueError, OverflowError):
        return values


def _guess_names(table: list[Array]) -> list[str]:
    """Name unnamed columns: x, y, z, then normals if the next three have unit length, then numbers."""
    names = [*_POINT]
    if len(table) >= 6 and all(column.dtype.kind in "fiu" for column in table[3:6]):
        length = np.sqrt(sum(column.astype(np.float64) ** 2 for column in table[3:6]))
        # Colours of 0 to 1 have this length only by chance; zero stands for "no normal".
        if np.all((np.abs(length - 1.0) < 1e-2) | (length == 0)) and np.any(length):
            names += _NORMAL
    return names + [f"column_{k + 1}" for k in range(len(names), len(table))]


def write(
    path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None
) -> None:
    """Write a text file of points; see `face_plugin.io.write_cloud`."""
    points, normals, attributes = columns(cloud, normals, extra, keep)
    comma = path.suffix.lower() == ".csv"
    layout = cloud.source
    if not isinstance(layout, _Layout):
        layout = _Layout(
            "," if comma else None,
            (),
            (*_POINT, *attributes),
            "" if comma else None,
            path.suffix.lower() == ".pts",
        )
    values: dict[str, Array] = {}
    for name in layout.names:
        plain = _plain(name)
        if plain in _POINT:
            values[name] = points[:, _POINT.index(plain)]
            if plain == "z" and normals is not None and not {*_NORMAL} <= {_plain(n) for n in layout.names}:
                values.update({n: normals[:, k] for k, n in enumerate(_NORMAL)})
        elif plain in _NORMAL and normals is not None:
            values[name] = normals[:, _NORMAL.index(plain)]
        else:
            values[name] = attributes[name]
    values.update({name: column for name, column in attributes.items() if name in extra})
    separator = layout.delimiter or " "
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(line + "\n" for line in layout.head)
        if layout.counted:
            stream.write(f"{len(points)}\n")
        if layout.header is not None:
            stream.write(layout.header + separator.join(values) + "\n")
        stream.write(interleave([format_column(column) for column in values.values()], separator))
