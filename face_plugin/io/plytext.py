"""Read the rows of ascii PLY files; what `plyread` does for binary ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from face_plugin.io.cloudfile import Array
from face_plugin.io.plydata import PlyElement

__all__ = ["RowError", "TextRows", "row_type"]


class RowError(Exception):
    """A row that cannot be read; the rows before it are kept in `rows`."""

    def __init__(self, reason: str, rows: Array) -> None:
        super().__init__(reason)
        self.rows = rows


def row_type(element: PlyElement, order: str, lengths: list[int]) -> np.dtype[Any]:
    """Type of a row whose lists are so long, without their counts."""
    fields: list[Any] = []
    for p, length in zip(element.properties, lengths, strict=True):
        kind = order + p.kind
        fields.append((p.name, kind) if p.length is None else (p.name, kind, (length,)))
    return np.dtype(fields)


class TextRows:
    """Rows of ascii files: one a line, blank lines left out."""

    def __init__(self, content: Array, start: int) -> None:
        self.lines = [line for line in bytes(content[start:]).splitlines() if line.strip()]
        self.first = self.next = 0

    def read(self, element: PlyElement, count: int) -> Array:
        """Read the rows of the next element; RowError where they are malformed or fewer."""
        if not element.properties:
            return np.empty(count, dtype=[])
        self.first = self.next
        lines = self.lines[self.next : self.next + count]
        self.next += len(lines)
        try:
            table = self._table(element, lines)
        except ValueError:
            together = self._joined(element, count)
            table = self._by_words(element, lines, count) if together is None else together
        if len(table) < count:
            raise RowError("early end-of-file", table)
        return table

    def _table(self, element: PlyElement, lines: list[bytes]) -> Array:
        """Parse lines of one width in one go."""
        lengths, at = [], 0
        first = lines[0].split() if lines else []
        for p in element.properties:
            lengths.append(0 if p.length is None or not lines else int(first[at]) if at < len(first) else -1)
            at += 1 if p.length is None else 1 + lengths[-1]
            if lengths[-1] < 0 or (at > max(len(first), 1) and lines):
                raise ValueError
        table = np.empty(len(lines), dtype=row_type(element, "=", lengths))
        if not lines:
            return table
        if at != len(first):
            raise ValueError
        numbers = np.loadtxt(lines, dtype=np.float64, ndmin=2, comments=None)
        if numbers.shape != (len(lines), at):
            raise ValueError
        column = 0
        for p, length in zip(element.properties, lengths, strict=True):
            if p.length is None:
                table[p.name] = _typed(numbers[:, column], p.kind)
                column += 1
            else:
                if (numbers[:, column] != length).any():
                    raise ValueError
                table[p.name] = _typed(numbers[:, column + 1 : column + 1 + length], p.kind)
                column += 1 + length
        return table

    def _joined(self, element: PlyElement, count: int) -> Array | None:
        """Read single values whose rows do not keep to lines; None where the words do not come out even."""
        if any(p.length is not None for p in element.properties):
            return None
        at = self.first
        words: list[bytes] = []
        while at < len(self.lines) and len(words) < count * len(element.properties):
            words += self.lines[at].split()
            at += 1
        if at < len(self.lines):
            # Rows with a word too many would come out even as well.
            return None
        try:
            numbers = np.array(words, dtype=np.float64).reshape(count, len(element.properties))
            columns = [_typed(numbers[:, k], p.kind) for k, p in enumerate(element.properties)]
        except ValueError:
            return None
        table = np.empty(count, dtype=row_type(element, "=", [0] * len(columns)))
        for p, values in zip(element.properties, columns, strict=True):
            table[p.name] = values
        self.next = at
        return table

    def _by_words(self, element: PlyElement, lines: list[bytes], count: int) -> Array:
        """Parse line by line, to the first that does not fit."""
        table = np.empty(
            len(lines), dtype=[(p.name, p.kind if p.length is None else object) for p in element.properties]
        )
        for k, line in enumerate(lines):
            words = line.split()
            at = 0
            try:
                for p in element.properties:
                    size = 1
                    if p.length is not None:
                        size = int(words[at])
                        at += 1
                    if size < 0 or len(words) < at + size:
                        raise IndexError
                    values = _typed(np.array([float(word) for word in words[at : at + size]]), p.kind)
                    table[p.name][k] = values[0] if p.length is None else values
                    at += size
                if at < len(words):
                    raise ValueError
            except (ValueError, IndexError) as error:
                last = k == len(lines) - 1 and self.next >= len(self.lines) and isinstance(error, IndexError)
                shown = line[:60].decode("latin-1")
                reason = "early end-of-line" if last else f"row {k + 1} is malformed ({shown!r})"
                raise RowError(reason, table[:k]) from None
        return table


def _typed(values: Array, kind: str) -> Array:
    """Cast numbers that were read as float64; ValueError where the type cannot hold them."""
    target = np.dtype(kind)
    if target.kind == "f":
        return values.astype(target)
    limits = np.iinfo(target)
    with np.errstate(invalid="ignore"):
        whole = (values >= limits.min) & (values <= limits.max)
    if not whole.all():
        raise ValueError(f"{values[~whole].flat[0]} does not fit into {target}")
    return values.astype(target)
