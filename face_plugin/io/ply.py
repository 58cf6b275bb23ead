"""PLY point clouds through plyfile: ascii and binary of both byte orders, everything else kept."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib.recfunctions import repack_fields
from plyfile import PlyData, PlyElement, PlyListProperty, PlyParseError, PlyProperty

from face_plugin.io.cloudfile import Array, CloudFile, columns, format_column, interleave, malformed

log = logging.getLogger(__name__)

_POINT = ("x", "y", "z")
_NORMAL = ("nx", "ny", "nz")
# plyfile reads lists row by row unless it knows their length; faces are mostly triangles.
_TRIANGLES = {"face": {"vertex_indices": 3, "vertex_index": 3}}
_EDGE = ("vertex1", "vertex2")


def read(path: Path) -> CloudFile:
    """Read a PLY file; see `face_plugin.io.read_cloud`."""
    try:
        try:
            data = PlyData.read(str(path), known_list_len=_TRIANGLES)
        except PlyParseError:
            data = PlyData.read(str(path))
    except (PlyParseError, ValueError, KeyError, OverflowError, MemoryError) as error:
        raise malformed(path, "PLY", error) from error
    names = [element.name for element in data.elements]
    if "vertex" not in names:
        raise malformed(path, "PLY", f"no element 'vertex', but {names}")
    vertex = data["vertex"]
    scalars = [p.name for p in vertex.properties if not isinstance(p, PlyListProperty)]
    if any(axis not in scalars for axis in _POINT):
        raise malformed(path, "PLY", f"'vertex' has no x, y, z, but {scalars}")
    for element in data.elements:
        # Out of the memory map: the file may be overwritten with what was read from it.
        element.data = repack_fields(np.array(element.data))
    return CloudFile(
        points=_stack(vertex.data, _POINT),
        normals=_stack(vertex.data, _NORMAL) if all(n in scalars for n in _NORMAL) else None,
        attributes={n: _native(vertex.data[n]) for n in scalars if n not in _POINT + _NORMAL},
        suffix=".ply",
        source=data,
    )


def _native(values: Array) -> Array:
    return values.astype(values.dtype.newbyteorder("="))


def _stack(data: Array, names: tuple[str, ...]) -> Array:
    return np.stack([_native(data[name]) for name in names], axis=1)


def write(
    path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None
) -> None:
    """Write a PLY file; see `face_plugin.io.write_cloud`."""
    source = cloud.source if isinstance(cloud.source, PlyData) else None
    if source is None:
        points, normals, attributes = columns(cloud, normals, extra, keep)
        properties = {**_named(points, _POINT), **({} if normals is None else _named(normals, _NORMAL))}
        write_elements(path, PlyData([element("vertex", {**properties, **attributes})], byte_order="<"))
        return
    vertex = source["vertex"]
    old = {p.name: vertex.data[p.name] for p in vertex.properties}
    properties = {}
    for name, values in old.items():
        properties[name] = values
        if name == "z" and normals is not None:
            # Readers that go by position expect the normal right after the point.
            properties.update({n: v for n, v in _named(normals, _NORMAL).items() if n not in old})
    if normals is not None:
        # A file that has normals keeps its own type for them.
        properties.update(
            {n: v.astype(old[n].dtype) for n, v in _named(normals, _NORMAL).items() if n in old}
        )
    properties.update(extra)
    if keep is not None:
        properties = {name: values[keep] for name, values in properties.items()}
    lists = {p.name: p for p in vertex.properties if isinstance(p, PlyListProperty)}
    elements = [
        element("vertex", properties, lists, vertex.comments) if e is vertex else _kept(e, keep)
        for e in source.elements
    ]
    out = PlyData(elements, text=source.text, byte_order=source.byte_order)
    out.comments, out.obj_info = source.comments, source.obj_info
    write_elements(path, out)


def _named(values: Array, names: tuple[str, ...]) -> dict[str, Array]:
    return {name: values[:, k] for k, name in enumerate(names)}


def element(
    name: str,
    values: Mapping[str, Array],
    lists: Mapping[str, Any] | None = None,
    comments: list[str] | None = None,
) -> Any:
    """Make a `PlyElement`: 2-d arrays become lists, other types the nearest that PLY has."""
    fields, properties, used = [], [], {}
    for key, column in values.items():
        typed = _ply_type(column)
        if typed is None:
            log.warning("%s is text, which PLY cannot hold: left out", key)
            continue
        column = typed
        label = "_".join(key.split()).encode("ascii", "replace").decode()
        used[label] = column
        if lists and key in lists:
            properties.append(lists[key])
        elif column.ndim == 2:
            properties.append(PlyListProperty(label, "u1", column.dtype.str[1:]))
        else:
            properties.append(PlyProperty(label, column.dtype.str[1:]))
        fields.append((label, column.dtype, column.shape[1:]))
    count = len(next(iter(used.values()))) if used else 0
    data = np.empty(count, dtype=fields)
    for label, column in used.items():
        data[label] = column
    made = PlyElement(name, properties, count, comments or [])
    made.data = data
    return made


def _ply_type(values: Array) -> Array | None:
    """Return the values in a type that PLY has, or None for text, which it cannot hold."""
    kind, size = values.dtype.kind, values.dtype.itemsize
    if kind == "O" or (kind in "iu" and size <= 4) or (kind == "f" and size in (4, 8)):
        return values
    if kind == "b":
        return values.astype(np.uint8)
    if kind in "iu":
        small = np.int32 if not len(values) or values.min() < 0 else np.uint32
        fits = not len(values) or np.iinfo(small).min <= values.min() <= values.max() <= np.iinfo(small).max
        return values.astype(small if fits else np.float64)
    if kind == "f":
        return values.astype(np.float32 if size == 2 else np.float64)
    return None


def _kept(old: Any, keep: Array | None) -> Any:
    """Renumber the vertices that an element refers to, and leave out its rows that refer to a dropped one."""
    names = old.data.dtype.names
    lists = [n for n in ("vertex_indices", "vertex_index") if n in names]
    if keep is None or not (lists or all(n in names for n in _EDGE)):
        return old
    new = np.where(keep, np.cumsum(keep) - 1, -1)
    rows = np.ones(len(old.data), dtype=bool)
    data = old.data.copy()
    for name in lists or _EDGE:
        if data.dtype[name].kind == "O":
            moved = [new[np.asarray(r)] for r in data[name]]
            rows &= np.array([bool((m >= 0).all()) for m in moved], dtype=bool)
            for k, row in enumerate(moved):
                data[name][k] = row
        else:
            indices = new[data[name]]
            rows &= (indices >= 0).reshape(len(indices), -1).all(axis=1)
            data[name] = indices
    made = PlyElement(old.name, old.properties, int(rows.sum()), old.comments)
    made.data = data[rows]
    return made


def write_elements(path: Path, data: Any) -> None:
    """Write the header through plyfile, and the rows in one piece (plyfile goes row by row)."""
    with open(path, "wb") as stream:
        stream.write(data.header.encode("ascii", "replace") + b"\n")
        for part in data.elements:
            if any(part.data.dtype[p.name].kind == "O" for p in part.properties):
                _write_ragged(stream, part, data.text, data.byte_order)
            elif data.text:
                stream.write(_ascii_rows(part).encode("ascii"))
            else:
                stream.write(_binary_rows(part, data.byte_order).tobytes())


def _binary_rows(part: Any, order: str) -> Array:
    fields: list[Any] = []
    for p in part.properties:
        if isinstance(p, PlyListProperty):
            length, value = p.list_dtype(order)
            fields += [(f"{p.name} length", length), (p.name, value, part.data.dtype[p.name].shape)]
        else:
            fields.append((p.name, p.dtype(order)))
    rows = np.empty(len(part.data), dtype=fields)
    for p in part.properties:
        rows[p.name] = part.data[p.name]
        if isinstance(p, PlyListProperty):
            rows[f"{p.name} length"] = part.data.dtype[p.name].shape[0]
    return rows


def _ascii_rows(part: Any) -> str:
    cols = []
    for p in part.properties:
        values = _native(part.data[p.name])
        if values.ndim == 2:
            cols.append([str(values.shape[1])] * len(values))
            cols += [format_column(values[:, k]) for k in range(values.shape[1])]
        else:
            cols.append(format_column(values))
    return interleave(cols, " ")


def _write_ragged(stream: BinaryIO, part: Any, text: bool, order: str) -> None:
    for row in part.data:
        fields: list[Array] = []
        for p in part.properties:
            if isinstance(p, PlyListProperty):
                length, value = p.list_dtype("=" if text else order)
                values = np.asarray(row[p.name], dtype=value)
                fields += [np.array([len(values)], dtype=length), values]
            else:
                fields.append(np.array([row[p.name]], dtype=p.dtype("=" if text else order)))
        if text:
            words = [word for values in fields for word in format_column(values)]
            stream.write((" ".join(words) + "\n").encode("ascii"))
        else:
            stream.write(b"".join(values.tobytes() for values in fields))
