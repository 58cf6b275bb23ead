"""Write PLY files: make elements of arrays, and put down header and rows."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from face_plugin.io.cloudfile import Array, format_column, interleave
from face_plugin.io.plydata import PlyData, PlyElement, PlyProperty

__all__ = ["binary_rows", "element", "native", "write_data"]

log = logging.getLogger(__name__)


def element(
    name: str,
    values: Mapping[str, Array],
    lists: Mapping[str, PlyProperty] | None = None,
    comments: tuple[str, ...] = (),
) -> PlyElement:
    """Make an element: 2-d arrays become lists, other types the nearest that PLY has.

    `lists` gives the properties of the columns that were lists in a file before.
    """
    properties, used = [], {}
    for key, column in values.items():
        typed = _ply_type(column)
        if typed is None:
            log.warning("%s is text, which PLY cannot hold: left out", key)
            continue
        label = "_".join(key.split()).encode("ascii", "replace").decode() or "unnamed"
        used[label] = typed
        if lists and key in lists:
            properties.append(lists[key])
        else:
            length = "u1" if typed.ndim == 2 and typed.shape[1] < 256 else "u4"
            properties.append(PlyProperty(label, typed.dtype.str[1:], length if typed.ndim == 2 else None))
    count = len(next(iter(used.values()))) if used else 0
    data = np.empty(count, dtype=[(label, c.dtype, c.shape[1:]) for label, c in used.items()])
    for label, column in used.items():
        data[label] = column
    return PlyElement(name, tuple(properties), data, comments)


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


def native(values: Array) -> Array:
    """Return the values in the byte order of this machine, in an array of their own."""
    return values.astype(values.dtype.newbyteorder("="))


def write_data(path: Path, data: PlyData) -> None:
    """Write header and rows."""
    with open(path, "wb") as stream:
        # Comments come back as the bytes that they were; others are written as UTF-8.
        try:
            stream.write(data.header.encode("latin-1"))
        except UnicodeEncodeError:
            stream.write(data.header.encode())
        for part in data.elements:
            if not part.properties:
                continue
            if part.data.dtype.hasobject:
                _write_ragged(stream, part, data.text, data.byte_order)
            elif data.text:
                stream.write(_text_rows(part).encode("ascii"))
            else:
                stream.write(binary_rows(part, data.byte_order).data)


def binary_rows(part: PlyElement, order: str) -> Array:
    """Return the rows as they stand in a binary file: lists with their counts, one byte order."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = []
    for p in part.properties:
        if p.length is not None:
            fields.append((f"{p.name} length", order + p.length))
        fields.append((p.name, order + p.kind, part.data.dtype[p.name].shape))
    rows = np.empty(len(part.data), dtype=fields)
    for p in part.properties:
        rows[p.name] = part.data[p.name]
        if p.length is not None:
            rows[f"{p.name} length"] = part.data.dtype[p.name].shape[0]
    return rows.view(np.uint8)


def _text_rows(part: PlyElement) -> str:
    cols = []
    for p in part.properties:
        values = native(part.data[p.name])
        if values.ndim == 2:
            cols.append([str(values.shape[1])] * len(values))
            cols += [format_column(values[:, k]) for k in range(values.shape[1])]
        else:
            cols.append(format_column(values))
    return interleave(cols, " ")


def _write_ragged(stream: BinaryIO, part: PlyElement, text: bool, order: str) -> None:
    """Write rows whose lists have several lengths: all rows of the same lengths at once, each to its place."""
    lengths = np.stack([_lengths(part, p) for p in part.properties], axis=1)
    groups, which = np.unique(lengths, axis=0, return_inverse=True)
    pieces: list[Array] = []
    lines = np.empty(len(part.data), dtype=object)
    for k in range(len(groups)):
        rows = np.flatnonzero(which.ravel() == k)
        columns = {p.name: _table(part.data[p.name][rows], p) for p in part.properties}
        data = np.empty(len(rows), dtype=[(name, v.dtype, v.shape[1:]) for name, v in columns.items()])
        for name, values in columns.items():
            data[name] = values
        same = PlyElement(part.name, part.properties, data)
        if text:
            lines[rows] = _text_rows(same).splitlines()
        else:
            pieces.append(binary_rows(same, order).reshape(len(rows), -1))
    if text:
        stream.write("".join(line + "\n" for line in lines).encode("ascii"))
        return
    sizes = np.array([piece.shape[1] for piece in pieces], dtype=np.int64)[which.ravel()]
    starts = np.cumsum(sizes) - sizes
    out = np.empty(int(sizes.sum()), dtype=np.uint8)
    for k, piece in enumerate(pieces):
        out[starts[which.ravel() == k][:, None] + np.arange(piece.shape[1])] = piece
    stream.write(out.data)


def _lengths(part: PlyElement, p: PlyProperty) -> Array:
    column = part.data[p.name]
    if p.length is None or not column.dtype.hasobject:
        return np.full(len(column), column.shape[1] if column.ndim == 2 else 0)
    return np.fromiter(map(len, column), np.int64, len(column))


def _table(column: Array, p: PlyProperty) -> Array:
    """Rows of one length as a table of the property's type."""
    values = np.array(column.tolist()) if column.dtype.hasobject else column
    return values.reshape(len(column), -1).astype(p.kind) if p.length is not None else values.astype(p.kind)
