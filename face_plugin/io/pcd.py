"""PCD point clouds (PCL, Open3D): ascii, binary and binary_compressed in; ascii and binary out."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, columns, format_column, interleave, malformed
from face_plugin.io.lzf import decompress
from face_plugin.io.names import COLOUR, NORMAL, POINT, meanings, with_colours

log = logging.getLogger(__name__)

_NORMAL = tuple(f"normal_{axis}" for axis in POINT)
_KINDS = {"F": "f", "I": "i", "U": "u"}
_NOWHERE = "0 0 0 1 0 0 0"
# More points than memory can be addressed for are a damaged header.
_MOST_POINTS = 2**48


@dataclass(frozen=True)
class _Header:
    fields: np.dtype[Any]
    count: int
    data: str
    viewpoint: str


def read(path: Path) -> CloudFile:
    """Read a PCD file; see `face_plugin.io.read_cloud`."""
    content = np.fromfile(path, np.uint8)
    try:
        header, start = _parse_header(content.tobytes())
        table = _rows(header, content[start:])
        viewpoint = np.array(header.viewpoint.split(), dtype=np.float64)
        if viewpoint.shape != (7,):
            raise ValueError(f"VIEWPOINT {header.viewpoint!r}, expected 7 numbers")
    except (ValueError, KeyError, IndexError, OverflowError, MemoryError, TypeError) as error:
        raise malformed(path, "PCD", error) from error
    names = [name for name in header.fields.names or () if not name.startswith("_")]
    found = meanings(names)
    if any(axis not in found or table[found[axis]].ndim != 1 for axis in POINT):
        raise malformed(path, "PCD", f"no x, y, z, but {names}")
    # Where a sensor's grid has no return, the coordinates are NaN.
    empty = np.any([np.isnan(table[found[axis]]) for axis in POINT], axis=0)
    if empty.any():
        log.info("%s: %d of %d places without a return are left out", path, empty.sum(), len(table))
        table = table[~empty]
    has_normals = all(n in found for n in NORMAL)
    used = {found[n] for n in (*POINT, *(NORMAL if has_normals else ()))}
    attributes: dict[str, Array] = {}
    for name in names:
        if name in ("rgb", "rgba") and table.dtype[name].itemsize == 4 and table[name].ndim == 1:
            attributes.update(_unpacked(table[name], with_alpha=name == "rgba"))
        elif name not in used:
            attributes[name] = np.ascontiguousarray(table[name])
    return CloudFile(
        points=np.stack([table[found[n]] for n in POINT], axis=1),
        normals=np.stack([table[found[n]] for n in NORMAL], axis=1) if has_normals else None,
        attributes=attributes,
        suffix=".pcd",
        # Everybody writes zero where nothing is known, so zero says nothing.
        viewpoints=viewpoint[None, :3] if viewpoint[:3].any() else None,
        source=header,
    )


def _parse_header(content: bytes) -> tuple[_Header, int]:
    """Parse the lines up to DATA, and find where the points begin."""
    entries: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in entries:
        stop = content.find(b"\n", start)
        if stop < 0:
            raise ValueError("no line 'DATA'")
        line = content[start:stop].decode("latin-1").strip()
        start = stop + 1
        if line and not line.startswith("#"):
            key, *words = line.split()
            if key not in _KEYS:
                raise ValueError(f"line {line[:60]!r} in the header")
            entries["FIELDS" if key == "COLUMNS" else key] = words
    names, sizes, types = entries["FIELDS"], entries["SIZE"], entries["TYPE"]
    counts = [int(word) for word in entries.get("COUNT", ["1"] * len(names))]
    if not len(names) == len(sizes) == len(types) == len(counts):
        raise ValueError(f"{len(names)} FIELDS, {len(sizes)} SIZE, {len(types)} TYPE, {len(counts)} COUNT")
    fields: list[Any] = []
    for k, (name, size, kind, count) in enumerate(zip(names, sizes, types, counts, strict=True)):
        if not 0 <= count < 2**20:
            raise ValueError(f"COUNT {count} of field {name!r}")
        label = f"_{k}" if name == "_" or name in names[:k] else name
        fields.append((label, f"<{_KINDS[kind]}{size}", *([(count,)] if count != 1 else [])))
    width, height = (int(entries.get(key, ["1"])[0]) for key in ("WIDTH", "HEIGHT"))
    points = int(entries["POINTS"][0]) if "POINTS" in entries else width * height
    if not 0 <= points < _MOST_POINTS:
        raise ValueError(f"POINTS {points}")
    viewpoint = " ".join(entries.get("VIEWPOINT", _NOWHERE.split()))
    return _Header(np.dtype(fields), points, entries["DATA"][0].lower(), viewpoint), start


_KEYS = ("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")


def _rows(header: _Header, body: Array) -> Array:
    kind, count = header.fields, header.count
    if header.data == "ascii":
        return _text_rows(header, body.tobytes())
    size = kind.itemsize * count
    if header.data == "binary":
        if len(body) < size:
            raise ValueError(f"{count} points need {size} bytes, the file has {len(body)}: early end-of-file")
        return body[:size].view(kind)
    if header.data != "binary_compressed":
        raise ValueError(f"DATA {header.data!r}, allowed are ascii, binary, binary_compressed")
    packed, unpacked = (int(n) for n in body[:8].view("<u4")) if len(body) >= 8 else (0, 0)
    if unpacked != size or len(body) < 8 + packed:
        found = f"{len(body) - 8} compressed bytes for {unpacked}"
        raise ValueError(f"{count} points need {packed} compressed bytes for {size}, the file has {found}")
    flat = decompress(body[8 : 8 + packed], size)
    table = np.empty(count, dtype=kind)
    at = 0
    # Compressed files hold one field after the other.
    for name in kind.names or ():
        width = kind[name].itemsize * count
        table[name] = flat[at : at + width].view(kind[name].base).reshape(table[name].shape)
        at += width
    return table


def _text_rows(header: _Header, text: bytes) -> Array:
    kind, count = header.fields, header.count
    lines = [line for line in text.splitlines() if line.strip()][:count]
    if len(lines) < count:
        raise ValueError(f"{count} points in the header, {len(lines)} in the file: early end-of-file")
    table = np.empty(count, dtype=kind)
    widths = [int(np.prod(kind[name].shape, dtype=int)) for name in kind.names or ()]
    numbers = np.loadtxt(lines, dtype=np.float64, ndmin=2, comments=None) if count else np.empty((0, sum(widths)))
    if numbers.shape[1] != sum(widths):
        raise ValueError(f"rows of {numbers.shape[1]} numbers for {sum(widths)} in the header")
    at = 0
    for name, width in zip(kind.names or (), widths, strict=True):
        values = numbers[:, at : at + width].reshape(table[name].shape)
        with np.errstate(invalid="ignore", over="ignore"):
            if name in ("rgb", "rgba") and kind[name].kind == "f" and np.all(values == np.rint(values)):
                # Some print the packed integer instead of the number that has its bits.
                table[name] = values.astype(np.uint32).view(np.float32)
            else:
                table[name] = values.astype(kind[name].base)
        at += width
    return table


def _unpacked(values: Array, *, with_alpha: bool) -> dict[str, Array]:
    """Bytes of colours that are packed into 32 bits."""
    bits = np.ascontiguousarray(values).view(np.uint32)
    colours = {name: (bits >> shift & 255).astype(np.uint8) for name, shift in zip(COLOUR, (16, 8, 0), strict=True)}
    return {**colours, "alpha": (bits >> 24).astype(np.uint8)} if with_alpha else colours


def write(path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None) -> None:
    """Write a PCD file, ascii if it was, else binary; see `face_plugin.io.write_cloud`."""
    points, normals, attributes = columns(cloud, normals, extra, keep)
    fields = {axis: points[:, k] for k, axis in enumerate(POINT)}
    if normals is not None:
        # PCL knows normals in single precision only.
        fields.update({name: normals[:, k].astype(np.float32) for k, name in enumerate(_NORMAL)})
    attributes = with_colours(attributes)
    if all(name in attributes for name in COLOUR):
        packed = np.zeros(len(points), dtype=np.uint32)
        for name, shift in zip(COLOUR, (16, 8, 0), strict=True):
            packed |= attributes.pop(name).astype(np.uint32) << np.uint32(shift)
        # A float, because that is what both hosts look for.
        fields["rgb"] = packed.view(np.float32)
    for name, values in attributes.items():
        if values.dtype.kind in "fiub":
            label = "_".join(name.split()) or "unnamed"
            fields[label] = values.astype(np.uint8) if values.dtype.kind == "b" else values
    _write_fields(path, fields, cloud)


def _write_fields(path: Path, fields: dict[str, Array], cloud: CloudFile) -> None:
    source = cloud.source if isinstance(cloud.source, _Header) else None
    text = source is not None and source.data == "ascii"
    pose = _NOWHERE if source is None else source.viewpoint
    if source is None and cloud.viewpoints is not None and len(cloud.viewpoints) == 1:
        pose = " ".join(map(repr, cloud.viewpoints[0].tolist())) + " 1 0 0 0"
    fields = {k: v.astype(np.float32) if v.dtype == np.float16 else v for k, v in fields.items()}
    count = len(fields["x"])
    types = [{"f": "F", "i": "I", "u": "U"}[values.dtype.kind] for values in fields.values()]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        "FIELDS " + " ".join(fields),
        "SIZE " + " ".join(str(values.dtype.itemsize) for values in fields.values()),
        "TYPE " + " ".join(types),
        "COUNT " + " ".join("1" for _ in fields),
        f"WIDTH {count}",
        "HEIGHT 1",
        f"VIEWPOINT {pose}",
        f"POINTS {count}",
        "DATA " + ("ascii" if text else "binary"),
    ]
    with open(path, "wb") as stream:
        stream.write(("\n".join(lines) + "\n").encode())
        if text:
            stream.write(interleave([format_column(values) for values in fields.values()], " ").encode())
        else:
            table = np.empty(count, dtype=[(name, "<" + v.dtype.str[1:]) for name, v in fields.items()])
            for name, values in fields.items():
                table[name] = values
            stream.write(table.tobytes())
