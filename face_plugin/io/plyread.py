"""Read the rows of a PLY file. What the header claims is held against what the file has before it is believed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from face_plugin.io.cloudfile import Array
from face_plugin.io.plydata import PlyData, PlyElement, parse_header
from face_plugin.io.plytext import RowError, TextRows, row_type

__all__ = ["read_data"]


def read_data(path: Path, *, mapped: bool = False) -> PlyData:
    """Read a PLY file: ascii or binary of either byte order.

    What follows sound vertices may be broken: its rows are read as far as they go, and `PlyData.problems` says
    what is missing.

    Parameters
    ----------
    path : Path
    mapped : bool
        Leave binary rows on the disk, and read them where they are used.

    Raises
    ------
    ValueError
        The header or the vertices are malformed, or the file ends before they do.
    OSError
        The file cannot be opened.
    """
    if path.stat().st_size == 0:
        raise ValueError("the file is empty: early end-of-file")
    content = np.memmap(path, np.uint8, mode="r") if mapped else np.fromfile(path, np.uint8)
    data, counts, start = parse_header(bytes(content[: _header_size(content)]))
    rows = TextRows(content, start) if data.text else _BinaryRows(content, start, data.byte_order)
    broken = False
    for element, count in zip(data.elements, counts, strict=True):
        if broken:
            element.data = np.empty(0, dtype=row_type(element, "=", [0] * len(element.properties)))
            if count:
                data.problems.append(f"the {count} rows of {element.name!r} behind that are left out")
            continue
        try:
            element.data = rows.read(element, count)
        except RowError as error:
            broken = True
            element.data = error.rows
            found = len(error.rows)
            if element.name == "vertex" or "vertex" not in [
                e.name for e in data.elements[: data.elements.index(element)]
            ]:
                raise ValueError(f"{error}: element {element.name!r} has {found} of {count} rows") from None
            if "malformed" in str(error):
                data.problems.append(f"{error} in element {element.name!r}: only the rows before it are kept")
            else:
                data.problems.append(f"the header promises {count} rows of {element.name!r}, the file has {found}")
    return data


def _header_size(content: Array) -> int:
    """Bytes to look for the header in: up to its last word and the line's end, in growing steps."""
    size = 1 << 14
    while size < len(content) and b"end_header" not in bytes(content[:size]):
        size *= 4
    return min(2 * size, len(content))


class _BinaryRows:
    """Rows of binary files, element by element."""

    def __init__(self, content: Array, start: int, order: str) -> None:
        self.content, self.start, self.order = content, start, order

    def read(self, element: PlyElement, count: int) -> Array:
        if all(p.length is None for p in element.properties):
            kind = row_type(element, self.order, [0] * len(element.properties))
            if not kind.itemsize:
                return np.empty(count, dtype=kind)
            rows = self._view(kind, count)
            self.start += len(rows) * kind.itemsize
            if len(rows) < count:
                raise RowError("early end-of-file", rows)
            return rows
        return self._lists(element, count)

    def _view(self, kind: np.dtype[Any], count: int) -> Array:
        """Up to `count` rows of that type from here, as many as the file has."""
        fit = min(count, (len(self.content) - self.start) // kind.itemsize)
        rows: Array = self.content[self.start : self.start + fit * kind.itemsize].view(kind)
        return rows

    def _lists(self, element: PlyElement, count: int) -> Array:
        """Read rows with lists: at once where all are as long as the first row's, else by their lengths."""
        names = [p.name for p in element.properties]
        starts, lengths, end = self._starts(element, min(count, 1))
        if len(starts):
            kind = self._counted_type(element, lengths[0].tolist())
            rows = self._view(kind, count)
            lists = [(p.name, n) for p, n in zip(element.properties, lengths[0], strict=True) if p.length is not None]
            if len(rows) == count and all((rows[f"{name} length"] == n).all() for name, n in lists):
                self.start += kind.itemsize * count
                return rows[names]
        starts, lengths, end = self._starts(element, count)
        table = self._grouped(element, starts, lengths)
        self.start = end
        if len(starts) < count:
            raise RowError("early end-of-file", table)
        return table

    def _grouped(self, element: PlyElement, starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> Array:
        """Read rows that begin at these bytes, all of one set of lengths at once."""
        names = [p.name for p in element.properties]
        same = [len(column) == 0 or bool((column == column[0]).all()) for column in lengths.T]
        fields: list[Any] = []
        for p, one, column in zip(element.properties, same, lengths.T, strict=True):
            if p.length is None:
                fields.append((p.name, self.order + p.kind))
            else:
                fields.append((p.name, self.order + p.kind, (int(column[:1].sum()),)) if one else (p.name, object))
        table = np.empty(len(starts), dtype=fields)
        # Mostly one list varies, and one column is sorted much faster than rows are.
        varying = lengths[:, np.logical_not(same)]
        key = varying[:, 0] if varying.shape[1] == 1 else np.unique(varying, axis=0, return_inverse=True)[1].ravel()
        _, first, which = np.unique(key, return_index=True, return_inverse=True)
        for k, row in enumerate(first):
            rows = np.flatnonzero(which == k)
            kind = self._counted_type(element, lengths[row].tolist())
            part = self.content[starts[rows][:, None] + np.arange(kind.itemsize)].view(kind)[:, 0]
            for name in names:
                table[name][rows] = _boxed(part[name]) if table.dtype[name].hasobject else part[name]
        return table

    def _starts(self, element: PlyElement, count: int) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
        """Where each row begins, (r,), the lengths of its lists, (r, properties), and where the rows end."""
        view, size = self.content.data, len(self.content)
        order: Literal["little", "big"] = "big" if self.order == ">" else "little"
        steps = [
            (int((p.length or "u0")[1:]), int(p.kind[1:]), (p.length or "u")[0] == "i") for p in element.properties
        ]
        begun: list[int] = []
        found: list[list[int]] = []
        at = self.start
        while len(begun) < count:
            row, lengths = at, []
            for head, item, signed in steps:
                length = 1
                if head:
                    length = int.from_bytes(view[row : row + head], order, signed=signed)
                    if length < 0 or row + head > size:
                        length = size
                row += head + item * length
                lengths.append(length)
            if row > size:
                break
            begun.append(at)
            found.append(lengths)
            at = row
        columns = np.array(found, dtype=np.int64).reshape(-1, len(steps))
        return np.array(begun, dtype=np.int64), columns, at

    def _counted_type(self, element: PlyElement, lengths: list[int]) -> np.dtype[Any]:
        fields: list[Any] = []
        for p, length in zip(element.properties, lengths, strict=True):
            if p.length is None:
                fields.append((p.name, self.order + p.kind))
            else:
                fields.append((f"{p.name} length", self.order + p.length))
                fields.append((p.name, self.order + p.kind, (length,)))
        return np.dtype(fields)


def _boxed(values: Array) -> Array:
    """Rows of a table as objects: arrays of arrays of one length must not become a table again."""
    out = np.empty(len(values), dtype=object)
    for k, row in enumerate(values):
        out[k] = row
    return out
