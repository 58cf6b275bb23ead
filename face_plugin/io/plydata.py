"""What a PLY file is made of, and its header as text; the rows are in `plyread` and `plywrite`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from face_plugin.io.cloudfile import Array

__all__ = ["PlyData", "PlyElement", "PlyProperty", "parse_header"]

_NAMES = {
    "i1": ("char", "int8"),
    "u1": ("uchar", "uint8"),
    "i2": ("short", "int16"),
    "u2": ("ushort", "uint16"),
    "i4": ("int", "int32"),
    "u4": ("uint", "uint32"),
    "f4": ("float", "float32"),
    "f8": ("double", "float64"),
    # No part of the format, but written by some.
    "i8": ("int64", "long"),
    "u8": ("uint64", "ulong"),
}
_CODES = {name: code for code, names in _NAMES.items() for name in names}
_FORMATS = {"ascii": (True, "="), "binary_little_endian": (False, "<"), "binary_big_endian": (False, ">")}
# More rows than memory can be addressed for are a damaged header, and beyond what NumPy counts with.
_MOST_ROWS = 2**48


@dataclass(frozen=True)
class PlyProperty:
    """A value of a row; `length` is the type of a list's count, and None for a single value.

    Types are NumPy codes without byte order, such as ``"f4"``.
    """

    name: str
    kind: str
    length: str | None = None

    @property
    def header(self) -> str:
        """The line of the header."""
        length = "" if self.length is None else f"list {_NAMES[self.length][0]} "
        return f"property {length}{_NAMES[self.kind][0]} {self.name}"


@dataclass
class PlyElement:
    """A table; lists are 2-d fields where all have one length, and fields of objects (arrays) elsewhere."""

    name: str
    properties: tuple[PlyProperty, ...]
    data: Array
    comments: tuple[str, ...] = ()

    @property
    def scalars(self) -> list[str]:
        """Names of the properties that are no lists."""
        return [p.name for p in self.properties if p.length is None]


@dataclass
class PlyData:
    """A file: elements in their order, and what else the header says."""

    elements: list[PlyElement]
    text: bool = False
    byte_order: str = "<"
    comments: tuple[str, ...] = ()
    obj_info: tuple[str, ...] = ()
    problems: list[str] = field(default_factory=list)
    """What was left out when it was read."""

    def __getitem__(self, name: str) -> PlyElement:
        """Return the element of that name, or raise KeyError."""
        for element in self.elements:
            if element.name == name:
                return element
        raise KeyError(name)

    @property
    def header(self) -> str:
        """The header, with its closing newline."""
        return self.header_for({element.name: len(element.data) for element in self.elements})

    def header_for(self, counts: dict[str, int]) -> str:
        """Return the header of a file whose elements have so many rows."""
        kind = next(name for name, form in _FORMATS.items() if form == (self.text, self.byte_order))
        lines = ["ply", f"format {kind} 1.0"]
        lines += [f"comment {line}" for line in self.comments]
        lines += [f"obj_info {line}" for line in self.obj_info]
        for element in self.elements:
            lines.append(f"element {element.name} {counts[element.name]}")
            lines += [f"comment {line}" for line in element.comments]
            lines += [p.header for p in element.properties]
        return "\n".join(lines) + "\nend_header\n"


def parse_header(content: bytes) -> tuple[PlyData, list[int], int]:
    """Parse the header at the beginning of `content`.

    Returns
    -------
    data : PlyData
        Elements without rows.
    counts : list of int
        Rows that each element claims to have.
    end : int
        Where the rows begin, in bytes.

    Raises
    ------
    ValueError
        It is no PLY header, with the line that is at fault.
    """
    lines, end = _header_lines(content)
    data, counts, form = PlyData([]), [], False
    for number, line in enumerate(lines[1:], 2):
        keyword, rest = (*line.strip().split(None, 1), "", "")[:2]
        words = rest.split()
        try:
            if keyword == "format":
                data.text, data.byte_order = _FORMATS[words[0]]
                form = True
            elif keyword == "comment":
                _add_comment(data, rest)
            elif keyword == "obj_info":
                data.obj_info += (rest,)
            elif keyword == "element":
                name, count = words[0], int(words[1])
                if not 0 <= count < _MOST_ROWS or name in [e.name for e in data.elements]:
                    raise ValueError
                data.elements.append(PlyElement(name, (), np.empty(0)))
                counts.append(count)
            elif keyword == "property":
                data.elements[-1].properties += (_property(words),)
            elif keyword:
                raise ValueError
        except (ValueError, KeyError, IndexError):
            fault = f"line {number} of the header: {line[:60]!r}"
            before = [e.name for e in (data.elements if keyword == "element" else data.elements[:-1])]
            if keyword not in ("element", "property") or "vertex" not in before:
                raise ValueError(fault) from None
            # What stands behind the vertices need not be understood to read them.
            data.problems.append(f"{fault}: elements from there on are left out")
            del data.elements[len(before) :], counts[len(before) :]
            break
    if not form:
        raise ValueError("no line 'format' in the header")
    for element in data.elements:
        names = [p.name for p in element.properties]
        if len(set(names)) < len(names):
            raise ValueError(f"two properties of one name in element {element.name!r}: {names}")
    return data, counts, end


def _header_lines(content: bytes) -> tuple[list[str], int]:
    first = content[:80].splitlines()[:1]
    if not first or first[0].strip() != b"ply":
        raise ValueError("the first line is not 'ply'")
    # Lines end as the first one does; a carriage return alone is what old systems wrote.
    ending = content[len(first[0]) : len(first[0]) + 2]
    newline = b"\r" if ending[:1] == b"\r" and ending != b"\r\n" else b"\n"
    lines: list[str] = []
    start = 0
    while True:
        stop = content.find(newline, start)
        line = content[start : stop if stop >= 0 else len(content)]
        # Comments may be in any encoding; names of elements and properties are ASCII.
        lines.append(line.decode("latin-1").rstrip("\r"))
        start = stop + 1
        if lines[-1].strip() == "end_header":
            return lines[:-1], start if stop >= 0 else len(content)
        if stop < 0:
            raise ValueError("no line 'end_header': not a PLY header, or an early end-of-file")


def _add_comment(data: PlyData, text: str) -> None:
    if data.elements:
        data.elements[-1].comments += (text,)
    else:
        data.comments += (text,)


def _property(words: list[str]) -> PlyProperty:
    if words[0] == "list":
        length, kind, name = words[1:]
        if _CODES[length][0] == "f":
            raise ValueError
        return PlyProperty(name, _CODES[kind], _CODES[length])
    kind, name = words
    return PlyProperty(name, _CODES[kind])
