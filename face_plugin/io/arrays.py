"""NumPy point clouds: one array (.npy) or several (.npz)."""

from __future__ import annotations

import logging
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, Literal

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, columns, malformed
from face_plugin.io.names import NORMAL, POINT, axes_of, guess_names, is_known, meanings

log = logging.getLogger(__name__)

# Packed numbers rarely shrink to less; what unpacks to more than this many times the file is told.
_USUAL_RATIO = 20
_POINT_KEYS = ("points", "vertices", "xyz", "positions", "pos", "coords")


def read(path: Path) -> CloudFile:
    """Read an NPY or NPZ file; see `face_plugin.io.read_cloud`."""
    kind = path.suffix[1:].upper()
    try:
        if path.suffix.lower() == ".npz":
            return _from_npz(path, *_members(path))
        loaded = load_npy(path)
    except (ValueError, EOFError, KeyError, OverflowError, MemoryError, zipfile.BadZipFile) as error:
        if str(error).startswith(f"{path}: "):
            raise
        raise malformed(path, kind, error) from error
    if loaded.dtype.names is not None:
        return _from_records(path, loaded)
    check_table(path, loaded, least=2)
    names = array_names(loaded)
    has_normals = all(n in names for n in NORMAL)
    return CloudFile(
        points=loaded[:, : min(loaded.shape[1], 3)],
        normals=loaded[:, 3:6] if has_normals else None,
        attributes={name: loaded[:, k] for k, name in enumerate(names) if name not in POINT + NORMAL},
        suffix=".npy",
    )


def load_npy(path: Path, *, mapped: bool = False) -> Array:
    """Read an NPY file, or leave its rows on the disk.

    Raises
    ------
    ValueError
        It is damaged, or claims more than the file has.
    """
    size = path.stat().st_size
    with open(path, "rb") as stream:
        shape, fortran, dtype = _header(stream, size)
        if dtype.hasobject:
            raise ValueError("it holds Python objects, which are not loaded")
        count = int(np.prod(shape, dtype=object))
        if mapped and count and dtype.itemsize:
            order: Literal["F", "C"] = "F" if fortran else "C"
            return np.memmap(path, dtype, mode="r", offset=stream.tell(), shape=shape, order=order)
        return _shaped(np.fromfile(stream, dtype=dtype, count=count), shape, fortran, dtype)


def _header(stream: IO[bytes], size: int) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read the header of an array, and hold it against the bytes that there are."""
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(stream)
    except Exception as error:
        # A damaged header raises whatever Python's own parser does.
        raise ValueError(f"its header cannot be read: {error}") from error
    if dtype.hasobject:
        return shape, fortran, dtype
    # In Python's own integers, which do not overflow.
    if min(shape, default=0) < 0 or np.prod(shape, dtype=object) * max(dtype.itemsize, 1) > size - stream.tell():
        raise ValueError(f"its header claims {dtype} of shape {shape}, but the file has {size} bytes")
    return shape, fortran, dtype


def _shaped(flat: Array, shape: tuple[int, ...], fortran: bool, dtype: np.dtype[Any]) -> Array:
    if len(flat) < np.prod(shape, dtype=object):
        raise ValueError(f"its header claims {dtype} of shape {shape}, but only {len(flat)} values follow")
    return flat.reshape(shape[::-1]).T if fortran else flat.reshape(shape)


def _members(path: Path) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Arrays of an archive, and what was left out; what is no array at all is not mentioned."""
    arrays: dict[str, Array] = {}
    problems: list[str] = []
    with zipfile.ZipFile(path) as archive:
        unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > _USUAL_RATIO * path.stat().st_size:
            log.warning(
                "%s: unpacks to %.3g MB, %d times its size", path, unpacked / 1e6, unpacked // path.stat().st_size
            )
        for entry in archive.infolist():
            if not entry.filename.endswith(".npy"):
                continue
            try:
                with archive.open(entry) as stream:
                    shape, fortran, dtype = _header(stream, entry.file_size)
                    if dtype.hasobject:
                        problems.append(f"member {entry.filename!r} holds Python objects: left out")
                        continue
                    count = int(np.prod(shape, dtype=object))
                    flat = np.zeros(count, dtype)
                    if dtype.itemsize:
                        flat = np.frombuffer(bytearray(stream.read(count * dtype.itemsize)), dtype)
                    arrays[entry.filename[:-4]] = _shaped(flat, shape, fortran, dtype)
            except (NotImplementedError, RuntimeError) as error:
                raise ValueError(f"member {entry.filename!r}: {error}") from error
            except zipfile.BadZipFile:
                raise
            except Exception as error:
                # What zlib and NumPy raise on a damaged member; named, because there are others.
                raise ValueError(f"member {entry.filename!r}: {error}") from error
    return arrays, tuple(problems)


def in_plane(path: Path) -> bool:
    """Whether an NPY file holds points in the plane."""
    try:
        loaded = load_npy(path, mapped=True)
    except (ValueError, OSError):
        return False
    if loaded.dtype.names is not None:
        return len(record_axes(loaded.dtype)) == 2
    return loaded.ndim == 2 and loaded.shape[1] == 2


def check_table(path: Path, loaded: Array, *, least: int = 3) -> None:
    """Raise ValueError unless an array has three columns of numbers or more; `least` 2 admits points in the plane."""
    if loaded.ndim != 2 or loaded.shape[1] < least or loaded.dtype.kind not in "fiu":
        found = f"{loaded.dtype} array of shape {loaded.shape}"
        raise malformed(path, "NPY", f"{found}, expected numbers of shape (n, 3) or more columns")


def array_names(loaded: Array) -> list[str]:
    """Name the columns of an array: 4 to 6 are normals by common use, unless they are bytes of colours."""
    names = guess_names([loaded[:, k] for k in range(loaded.shape[1])])
    if loaded.shape[1] >= 6 and names[3:6] == ["column_4", "column_5", "column_6"]:
        names[3:6] = NORMAL
    return names


def record_axes(dtype: np.dtype[Any]) -> tuple[str, ...]:
    """Return the axes of the points of records: x, y, z, or x, y in the plane."""
    names = dtype.names or ()
    return axes_of(meanings(names), rest=sum(not is_known(name) for name in names))


def check_records(
    path: Path, dtype: np.dtype[Any], shape: tuple[int, ...], axes: tuple[str, ...] = POINT
) -> dict[str, str]:
    """Return the fields of records by their meaning; ValueError unless x, y, z are numbers."""
    names = dtype.names or ()
    found = meanings(names)
    wrong = [axis for axis in axes if axis not in found or dtype[found[axis]].kind not in "fiu"]
    if wrong or len(shape) != 1:
        fields = {name: str(dtype[name]) for name in names}
        raise malformed(path, "NPY", f"records of shape {shape} with {fields}, expected numbers x, y, z")
    return found


def _from_records(path: Path, loaded: Array) -> CloudFile:
    axes = record_axes(loaded.dtype)
    found = check_records(path, loaded.dtype, loaded.shape, axes)
    of_normal = NORMAL[: len(axes)]
    has_normals = all(n in found and loaded.dtype[found[n]].kind in "fiu" for n in of_normal)
    used = {found[n] for n in (*axes, *(of_normal if has_normals else ()))}
    return CloudFile(
        points=np.stack([loaded[found[n]] for n in axes], axis=1),
        normals=np.stack([loaded[found[n]] for n in of_normal], axis=1) if has_normals else None,
        attributes={name: loaded[name] for name in loaded.dtype.names or () if name not in used},
        suffix=".npy",
        source="records",
    )


def _from_npz(path: Path, arrays: dict[str, Array], problems: tuple[str, ...]) -> CloudFile:
    found = [key for key in _POINT_KEYS if key in arrays]
    for dimension in (3, 2):
        found = found or [key for key, values in arrays.items() if values.ndim == 2 and values.shape[1] == dimension]
    shapes = {key: values.shape for key, values in arrays.items()}
    if not found:
        raise malformed(path, "NPZ", f"no array 'points' of shape (n, 3), but {shapes}")
    points = arrays[found[0]]
    if points.dtype.names is not None:
        cloud = _from_records(path, points)
        return CloudFile(cloud.points, cloud.normals, cloud.attributes, ".npz", problems=problems)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or points.dtype.kind not in "fiu":
        raise malformed(path, "NPZ", f"{found[0]!r} is {points.dtype} of shape {points.shape}, expected (n, 3)")
    normals = arrays.get("normals")
    if normals is not None and (normals.shape != points.shape or normals.dtype.kind not in "fiu"):
        normals = None
    attributes = {
        key: values
        for key, values in arrays.items()
        if key not in (found[0], "normals") and values.shape[:1] == (len(points),)
    }
    return CloudFile(
        points=points,
        normals=normals,
        attributes=attributes,
        suffix=".npz",
        problems=problems,
        source=(found[0], arrays),
    )


def write(path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None) -> None:
    """Write an NPY or NPZ file; see `face_plugin.io.write_cloud`."""
    if path.suffix.lower() == ".npz":
        key, arrays = cloud.source if cloud.suffix == ".npz" and cloud.source else ("points", {})
        normals = cloud.normals if normals is None else normals
        out = {**cloud.attributes, **extra, key: cloud.points}
        if normals is not None:
            out["normals"] = normals
        kept = {name: values if keep is None else values[keep] for name, values in out.items()}
        np.savez(path, **{**arrays, **kept})
        return
    points, normals, attributes = columns(cloud, normals, extra, keep)
    # Four columns would be points in space, and something more: what has names cannot be mistaken.
    if cloud.source == "records" or (points.shape[1] == 2 and normals is not None):
        named = {axis: points[:, k] for k, axis in enumerate(POINT[: points.shape[1]])}
        if normals is not None:
            named.update({name: normals[:, k] for k, name in enumerate(NORMAL[: points.shape[1]])})
        named.update(attributes)
        records = np.empty(len(points), dtype=[(name, values.dtype) for name, values in named.items()])
        for name, values in named.items():
            records[name] = values
        _save(path, records)
        return
    blocks = [points] if normals is None else [points, normals]
    blocks += [values[:, None] for values in attributes.values() if values.dtype.kind in "fiub"]
    _save(path, np.concatenate(blocks, axis=1))


def _save(path: Path, array: Array) -> None:
    """Write an array; unlike `numpy.save`, with the system's own words where the disk is full."""
    array = np.ascontiguousarray(array)
    with open(path, "wb") as stream:
        np.lib.format.write_array_header_1_0(stream, np.lib.format.header_data_from_array_1_0(array))
        stream.write(array.reshape(-1).view(np.uint8).data)
