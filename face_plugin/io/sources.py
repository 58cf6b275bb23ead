"""Clouds that are read in parts: arrays, memory-mapped NPY and PLY, and LAS/LAZ."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import require
from face_plugin.io.arrays import check_records, check_table, load_npy
from face_plugin.io.cloudfile import malformed
from face_plugin.io.lascheck import check_las

__all__ = ["STREAMED", "ArraySource", "LasSource", "Source", "open_source"]

CHUNK = 1_000_000
"""Points in a part."""
STREAMED = (".npy", ".ply", ".las", ".laz")
"""Extensions of the files that can be read in parts."""
_HASHED_AT_ONCE = 1 << 24

Part = tuple[NDArray[Any], dict[str, NDArray[Any]]]
"""Points (k, 3) and their other values by name."""


class Source(Protocol):
    """A cloud that can be read from its beginning as often as needed, a part at a time."""

    count: int
    dtype: np.dtype[Any]

    def parts(self, size: int = CHUNK) -> Iterator[Part]:
        """Yield the points in their order, `size` at a time."""

    def digest(self) -> str:
        """Hash of the content."""


class ArraySource:
    """Points in memory, or a memory map.

    Examples
    --------
    >>> [len(points) for points, _ in ArraySource(np.zeros((5, 3))).parts(2)]
    [2, 2, 1]
    """

    def __init__(self, points: NDArray[Any], attributes: dict[str, NDArray[Any]] | None = None) -> None:
        self.points = points
        self.attributes = attributes or {}
        self.count = len(points)
        self.dtype = points.dtype

    def parts(self, size: int = CHUNK) -> Iterator[Part]:
        """Yield the points in their order, `size` at a time."""
        for start in range(0, self.count, size):
            part = slice(start, start + size)
            yield self.points[part], {name: values[part] for name, values in self.attributes.items()}

    def digest(self) -> str:
        """Hash of the coordinates."""
        state = hashlib.blake2b(f"{self.dtype.str} {self.points.shape}".encode())
        for points, _ in self.parts():
            state.update(np.ascontiguousarray(points).data)
        return state.hexdigest()


class _RecordSource:
    """Records with x, y, z in a memory map."""

    def __init__(self, path: Path, records: NDArray[Any], names: dict[str, str]) -> None:
        self.path = path
        self.records = records
        self.count = len(records)
        self._axes = [names[axis] for axis in "xyz"]
        self.dtype = np.dtype(records.dtype[self._axes[0]].newbyteorder("="))

    def parts(self, size: int = CHUNK) -> Iterator[Part]:
        """Yield the points in their order, `size` at a time."""
        for start in range(0, self.count, size):
            # A copy: fields of a memory map are read from disk each time they are touched.
            records = np.array(self.records[start : start + size])
            values = {name: _native(records[name]) for name in records.dtype.names or ()}
            yield np.stack([values.pop(axis) for axis in self._axes], axis=1), values

    def digest(self) -> str:
        """Hash of the file."""
        return _file_digest(self.path)


class LasSource:
    """LAS or LAZ, decompressed a part at a time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._laspy: Any = require("laspy", extra="las")
        try:
            check_las(path)
            with self._laspy.open(str(path)) as reader:
                self.count = int(reader.header.point_count)
                self.names = list(reader.header.point_format.dimension_names)
        except OSError:
            raise
        except Exception as error:
            # laspy and its back ends raise many types on a broken file; all mean that it is not a cloud.
            raise malformed(path, path.suffix[1:].upper(), error) from error
        self.dtype = np.dtype(np.float64)

    def parts(self, size: int = CHUNK) -> Iterator[Part]:
        """Yield the points in their order, `size` at a time."""
        with self._laspy.open(str(self.path)) as reader:
            for records in reader.chunk_iterator(size):
                points = np.stack([np.asarray(records[axis]) for axis in "xyz"], axis=1)
                yield points, {name: np.asarray(records[name]) for name in self.names if name not in ("X", "Y", "Z")}

    def digest(self) -> str:
        """Hash of the file."""
        return _file_digest(self.path)


def open_source(path: Path) -> Source:
    """Open a file that can be read in parts.

    Parameters
    ----------
    path : Path
        NPY of shape (n, 3) or more columns, binary PLY with x, y, z, LAS or LAZ.

    Raises
    ------
    ValueError
        The file is of another kind, or malformed.
    OSError
        It cannot be opened.
    MissingDependencyError
        LAS/LAZ without laspy.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "cloud.npy"
    >>> np.save(path, np.eye(3))
    >>> open_source(path).count
    3
    """
    suffix = path.suffix.lower()
    if suffix not in STREAMED:
        raise ValueError(f"{path}: cannot be read in parts; allowed are {', '.join(STREAMED)}")
    if suffix == ".npy":
        return _open_npy(path)
    if suffix == ".ply":
        return _open_ply(path)
    return LasSource(path)


def _open_npy(path: Path) -> Source:
    try:
        array = load_npy(path, mapped=True)
    except ValueError as error:
        raise malformed(path, "NPY", error) from error
    if array.dtype.names is not None:
        return _RecordSource(path, array, check_records(path, array.dtype, array.shape))
    check_table(path, array)
    # Columns 4 to 6 of an array are its normals by common use, which the new ones replace.
    rest = range(6 if array.shape[1] >= 6 else 3, array.shape[1])
    return ArraySource(array[:, :3], {f"column_{k + 1}": array[:, k] for k in rest})


def _open_ply(path: Path) -> Source:
    from face_plugin.io.ply import vertices
    from face_plugin.io.plyread import read_data

    try:
        data = read_data(path, mapped=True)
        vertex, found = vertices(data)
    except (ValueError, OverflowError) as error:
        raise malformed(path, "PLY", error) from error
    return _RecordSource(path, vertex.data, found)


def _native(values: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(values).astype(values.dtype.newbyteorder("="), copy=False)


def _file_digest(path: Path) -> str:
    state = hashlib.blake2b()
    with open(path, "rb") as stream:
        while block := stream.read(_HASHED_AT_ONCE):
            state.update(block)
    return state.hexdigest()
