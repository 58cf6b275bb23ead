"""Wavefront OBJ point clouds and meshes; every line that is not about vertices stays as it is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, columns, format_column, interleave, malformed
from face_plugin.io.dialect import decoded
from face_plugin.io.names import COLOUR, with_colours


def read(path: Path) -> CloudFile:
    """Read an OBJ file; see `face_plugin.io.read_cloud`."""
    lines = decoded(path, "OBJ").replace("\r\n", "\n").replace("\\\n", " ").splitlines()
    points = _table(path, lines, "v")
    if points is None:
        raise malformed(path, "OBJ", "no line 'v x y z'")
    normals = _table(path, lines, "vn")
    coloured = points.shape[1] >= 6
    return CloudFile(
        points=np.ascontiguousarray(points[:, :3]),
        # Fewer or more normals than points belong to corners of faces, not to points.
        normals=normals[:, :3] if normals is not None and len(normals) == len(points) else None,
        attributes={name: points[:, 3 + k] for k, name in enumerate(COLOUR)} if coloured else {},
        suffix=".obj",
        source=lines,
    )


def check(path: Path, cloud: CloudFile) -> None:
    """Raise ValueError where a face, line or point names a vertex that is not there yet, or nothing."""
    seen = 0
    for number, line in enumerate(cloud.source, 1):
        keyword = _keyword(line)
        if keyword == "v":
            seen += 1
        elif keyword in ("f", "l", "p"):
            for word in line.split("#")[0].split()[1:]:
                try:
                    index = int(word.split("/")[0])
                except ValueError:
                    raise malformed(path, "OBJ", f"line {number}: {word[:40]!r} is no vertex") from None
                # Counted from 1, or backwards from the last; some write faces before their vertices.
                if not (1 <= index <= len(cloud) or -seen <= index <= -1):
                    found = f"line {number} names vertex {index} of {len(cloud)} (counted from 1)"
                    raise malformed(path, "OBJ", found)


def _keyword(line: str) -> str:
    words = line.split(None, 1)
    return words[0] if words else ""


def _table(path: Path, lines: list[str], keyword: str) -> Array | None:
    numbers = [k for k, line in enumerate(lines) if _keyword(line) == keyword]
    if not numbers:
        return None
    rows = [lines[k].split(None, 1)[-1] for k in numbers]
    try:
        table = np.loadtxt(rows, dtype=np.float64, ndmin=2, comments="#")
        if len(table) != len(rows) or table.shape[1] < 3:
            raise ValueError
    except ValueError:
        widths = {}
        for k, row in zip(numbers, rows, strict=True):
            words = row.split("#")[0].split()
            try:
                widths[k] = len([float(word) for word in words])
            except ValueError:
                widths[k] = 0
            if widths[k] < 3:
                raise malformed(path, "OBJ", f"line {k + 1}: {lines[k][:60]!r}") from None
        # Lines of different widths (a weight, or a colour, on some of them): the first three numbers count.
        table = np.array([[float(word) for word in row.split("#")[0].split()[:3]] for row in rows])
    return table


def write(path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None) -> None:
    """Write an OBJ file; see `face_plugin.io.write_cloud`. OBJ has no place for `extra`."""
    points, normals, attributes = columns(cloud, normals, {}, keep)
    attributes = with_colours(attributes)
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        if not isinstance(cloud.source, list):
            cols = [points[:, k] for k in range(3)]
            if all(name in attributes for name in COLOUR):
                cols += [_unit_colour(attributes[name]) for name in COLOUR]
            stream.write(interleave([format_column(column) for column in cols], " ", "v "))
            stream.write(_normal_lines(normals))
        else:
            stream.write(_rewrite(cloud.source, len(cloud), normals, keep))


def _unit_colour(values: Array) -> Array:
    if values.dtype.kind == "f":
        return values
    return np.round(values / np.iinfo(values.dtype).max, 4)


def _normal_lines(normals: Array | None) -> str:
    if normals is None:
        return ""
    return interleave([format_column(normals[:, k]) for k in range(3)], " ", "vn ")


def _rewrite(lines: list[str], count: int, normals: Array | None, keep: Array | None) -> str:
    """Copy the lines: normals replaced, corners of faces pointing at them, dropped vertices gone."""
    mask = np.ones(count, dtype=bool) if keep is None else keep
    # Index 0 of the table stands for "dropped".
    new = np.where(mask, np.cumsum(mask), 0).tolist()
    out: list[str] = []
    seen = 0
    for line in lines:
        keyword = _keyword(line)
        if keyword == "v":
            if new[seen]:
                out.append(line)
            seen += 1
            if seen == count:
                out.extend(_normal_lines(normals).splitlines())
        elif keyword in ("f", "l", "p"):
            words = [
                _corner(word, seen, new, keyword == "f" and normals is not None)
                for word in line.split("#")[0].split()[1:]
            ]
            if all(words):
                out.append(" ".join([keyword, *words]))
        elif keyword != "vn":
            out.append(line)
    return "\n".join(out) + "\n"


def _corner(word: str, seen: int, new: list[int], with_normal: bool) -> str:
    """Renumber a corner ``v``, ``v/vt``, ``v//vn`` or ``v/vt/vn``; empty if its vertex is dropped."""
    parts = word.split("/")
    index = int(parts[0])
    vertex = new[index - 1 if index > 0 else seen + index]
    if not vertex:
        return ""
    texture = parts[1] if len(parts) > 1 else ""
    if with_normal:
        return f"{vertex}/{texture}/{vertex}"
    return f"{vertex}/{texture}" if texture else str(vertex)
