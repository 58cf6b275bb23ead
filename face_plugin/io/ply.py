"""PLY point clouds: ascii and binary of both byte orders, everything that is no normal kept."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, columns, malformed
from face_plugin.io.names import NORMAL, POINT, meanings, with_colours
from face_plugin.io.plydata import PlyData, PlyElement
from face_plugin.io.plyread import read_data
from face_plugin.io.plywrite import element, native, write_data

CORNERS = ("vertex_indices", "vertex_index")
_EDGE = ("vertex1", "vertex2")


def read(path: Path) -> CloudFile:
    """Read a PLY file; see `face_plugin.io.read_cloud`."""
    try:
        data = read_data(path)
        vertex, found = vertices(data)
    except (ValueError, OverflowError, MemoryError) as error:
        raise malformed(path, "PLY", error) from error
    has_normals = all(n in found for n in NORMAL)
    used = {found[n] for n in (*POINT, *(NORMAL if has_normals else ()))}
    return CloudFile(
        points=_stack(vertex.data, found, POINT),
        normals=_stack(vertex.data, found, NORMAL) if has_normals else None,
        attributes={n: native(vertex.data[n]) for n in vertex.scalars if n not in used},
        suffix=".ply",
        source=data,
        problems=tuple(data.problems),
    )


def vertices(data: PlyData) -> tuple[PlyElement, dict[str, str]]:
    """Return the element of the points, and the names of its coordinates and normals by their meaning."""
    names = [e.name for e in data.elements]
    if "vertex" not in names:
        raise ValueError(f"no element 'vertex', but {names}")
    vertex = data["vertex"]
    found = meanings(vertex.scalars)
    if any(axis not in found for axis in POINT):
        raise ValueError(f"'vertex' has no x, y, z, but {vertex.scalars}")
    return vertex, found


def check(path: Path, cloud: CloudFile) -> None:
    """Raise ValueError where a face or an edge names a vertex that is not there."""
    for part in cloud.source.elements:
        names = part.data.dtype.names or ()
        if part.name == "tristrips" or not len(part.data):
            continue
        for name in [n for n in CORNERS if n in names] or (_EDGE if set(_EDGE) <= set(names) else ()):
            column = part.data[name]
            rows = column if column.dtype.hasobject else np.atleast_2d(column.T).T
            for k, row in _astray(rows, len(cloud)):
                found = f"row {k + 1} of {part.name!r} names vertex {row} of {len(cloud)} (counted from 0)"
                raise malformed(path, "PLY", found)


def _astray(rows: Array, count: int) -> list[tuple[int, int]]:
    """Find the first row with an index that is not in 0 ... count - 1: (row, index) in a list of one, or empty."""
    if not rows.dtype.hasobject:
        bad = (rows < 0) | (rows >= count)
        hits = np.argwhere(bad)[:1]
        return [(int(k), int(rows[k, c])) for k, c in hits]
    for k, row in enumerate(rows):
        wrong = row[(row < 0) | (row >= count)]
        if len(wrong):
            return [(k, int(wrong[0]))]
    return []


def _stack(data: Array, found: Mapping[str, str], names: tuple[str, ...]) -> Array:
    return np.stack([native(data[found[name]]) for name in names], axis=1)


def write(path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None) -> None:
    """Write a PLY file; see `face_plugin.io.write_cloud`."""
    source = cloud.source if isinstance(cloud.source, PlyData) else None
    if source is None:
        points, normals, attributes = columns(cloud, normals, extra, keep)
        properties = {**_named(points, POINT), **({} if normals is None else _named(normals, NORMAL))}
        write_data(path, PlyData([element("vertex", {**properties, **with_colours(attributes)})]))
        return
    vertex, found = vertices(source)
    own = [found.get(n, n) for n in NORMAL]
    old = {p.name: vertex.data[p.name] for p in vertex.properties}
    properties = {}
    for name, values in old.items():
        properties[name] = values
        if name == found["z"] and normals is not None:
            # Readers that go by position expect the normal right after the point.
            properties.update({n: normals[:, k] for k, n in enumerate(own) if n not in old})
    if normals is not None:
        # A file that has normals keeps its own type for them.
        properties.update({n: normals[:, k].astype(old[n].dtype) for k, n in enumerate(own) if n in old})
    properties.update(extra)
    if keep is not None:
        properties = {name: values[keep] for name, values in properties.items()}
    lists = {p.name: p for p in vertex.properties if p.length is not None}
    elements = [
        element("vertex", properties, lists, vertex.comments) if e is vertex else _kept(e, keep)
        for e in source.elements
    ]
    write_data(path, PlyData(elements, source.text, source.byte_order, source.comments, source.obj_info))


def _named(values: Array, names: tuple[str, ...]) -> dict[str, Array]:
    return {name: values[:, k] for k, name in enumerate(names)}


def _kept(old: PlyElement, keep: Array | None) -> PlyElement:
    """Renumber the vertices that an element refers to, and leave out its rows that refer to a dropped one."""
    names = old.data.dtype.names or ()
    lists = [n for n in CORNERS if n in names]
    if keep is None or not (lists or all(n in names for n in _EDGE)):
        return old
    new = np.where(keep, np.cumsum(keep) - 1, -1)
    if old.name == "tristrips":
        # A dropped vertex ends the strip; the triangles that follow would turn over with it.
        return PlyElement(old.name, old.properties, old.data[:0], old.comments)
    rows = np.ones(len(old.data), dtype=bool)
    data = old.data.copy()
    for name in lists or _EDGE:
        if data.dtype[name].hasobject:
            moved = [new[np.asarray(r)] for r in data[name]]
            rows &= np.array([bool((m >= 0).all()) for m in moved], dtype=bool)
            for k, row in enumerate(moved):
                data[name][k] = row
        else:
            indices = new[data[name]]
            rows &= (indices >= 0).all(axis=tuple(range(1, indices.ndim)))
            data[name] = indices
    return PlyElement(old.name, old.properties, data[rows], old.comments)
