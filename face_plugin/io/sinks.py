"""Clouds that are written in parts: NPY, binary PLY, LAS and LAZ."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import require
from face_plugin.io.disk import allocated
from face_plugin.io.las import LAS_NORMAL, colour_16_bit, las_writer, new_las
from face_plugin.io.names import COLOUR, NORMAL, POINT
from face_plugin.io.plydata import PlyData
from face_plugin.io.plywrite import binary_rows, element
from face_plugin.io.sources import LasSource, Source

__all__ = ["WRITERS"]

Array = NDArray[Any]
Columns = dict[str, Array]
"""x, y, z, the normals nx, ny, nz, and any other values of some points, by name."""

_LAS_NAMES = dict(zip(NORMAL, LAS_NORMAL, strict=True))


def _npy(path: Path, count: int, parts: Iterator[Columns], source: Source) -> None:
    """Write an array of one row a point: position, normal, and the other numbers."""
    out: Any = None
    seen = 0
    for part in parts:
        names = [*POINT, *NORMAL, *(name for name in part if name not in POINT + NORMAL)]
        block = np.stack([part[name] for name in names if part[name].dtype.kind in "fiub"], axis=1)
        if out is None:
            shape = (count, block.shape[1])
            out = allocated(path, block.dtype, shape)
        out[seen : seen + len(block)] = block
        seen += len(block)
    if out is None:
        np.save(path, np.empty((0, 6)), allow_pickle=False)
    else:
        out.flush()


def _ply(path: Path, count: int, parts: Iterator[Columns], source: Source) -> None:
    """Write a binary little-endian PLY with one element."""
    with open(path, "wb") as stream:
        wide = _has_wide_colours(source)
        for k, part in enumerate(parts):
            if isinstance(source, LasSource) and all(name in part for name in COLOUR):
                part = {**part, **{name: _byte(part[name], wide) for name in COLOUR}}
            # The type of a wide integer must not hang on the values of one part.
            narrow = {
                name: values.astype(np.float64) if values.dtype in (np.int64, np.uint64) else values
                for name, values in part.items()
            }
            vertex = element("vertex", narrow)
            if k == 0:
                stream.write(PlyData([vertex]).header_for({"vertex": count}).encode("ascii", "replace"))
            stream.write(binary_rows(vertex, "<").data)


def _has_wide_colours(source: Source) -> bool:
    """Whether the colours of a LAS use their 16 bits; some programs put bytes there. One part cannot tell."""
    return isinstance(source, LasSource) and any(
        name in values and values[name].max(initial=0) > 255 for _, values in source.parts() for name in COLOUR
    )


def _byte(values: Array, wide: bool) -> Array:
    return np.clip(np.rint(values / (257.0 if wide else 1.0)), 0, 255).astype(np.uint8)


def _las(path: Path, count: int, parts: Iterator[Columns], source: Source) -> None:
    """Write LAS or LAZ; the header of a source of that kind is kept."""
    laspy: Any = require("laspy", extra="las")
    header: Any = None
    writer: Any = None
    with ExitStack() as stack:
        for part in parts:
            named = {_LAS_NAMES.get(name, name[:32]): values for name, values in part.items()}
            if writer is None:
                header = _las_header(laspy, named, source)
                writer = stack.enter_context(las_writer(laspy, path, header))
            records = laspy.ScaleAwarePointRecord.zeros(len(named["x"]), header=header)
            for name, values in named.items():
                if name in POINT or name in set(header.point_format.dimension_names):
                    records[name] = colour_16_bit(values) if name in COLOUR else values
            writer.write_points(records)


def _las_header(laspy: Any, part: Columns, source: Source) -> Any:
    """Header of the source, or a new one around it, with dimensions for what it has no place for."""
    if isinstance(source, LasSource):
        with laspy.open(str(source.path)) as reader:
            header = reader.header
    else:
        corners = np.concatenate([[p.min(axis=0), p.max(axis=0)] for p, _ in source.parts()])
        header = new_las(laspy, corners).header
    known = {*POINT, *header.point_format.dimension_names}
    for name, values in part.items():
        if name not in known and values.dtype.kind in "fiub":
            kind = np.dtype(np.uint8) if values.dtype.kind == "b" else values.dtype
            header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=kind))
    return header


WRITERS: dict[str, Callable[[Path, int, Iterator[Columns], Source], None]] = {
    ".npy": _npy,
    ".ply": _ply,
    ".las": _las,
    ".laz": _las,
}
"""Writers by extension: ``write(path, number of points, parts, source)``."""
