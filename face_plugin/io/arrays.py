"""NumPy point clouds: one array (.npy) or several (.npz)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, columns, malformed

_POINT_KEYS = ("points", "vertices", "xyz", "positions", "pos", "coords")


def read(path: Path) -> CloudFile:
    """Read an NPY or NPZ file; see `face_plugin.io.read_cloud`."""
    try:
        loaded = np.load(path, allow_pickle=False)
        arrays = (
            {key: loaded[key] for key in loaded.files} if isinstance(loaded, np.lib.npyio.NpzFile) else None
        )
    except (ValueError, EOFError, BadZipFile, KeyError) as error:
        raise malformed(path, path.suffix[1:].upper(), error) from error
    if arrays is not None:
        return _from_npz(path, arrays)
    if loaded.dtype.names is not None:
        return _from_records(path, loaded)
    if loaded.ndim != 2 or loaded.shape[1] < 3 or loaded.dtype.kind not in "fiu":
        found = (
            f"{loaded.dtype} array of shape {loaded.shape}, expected numbers of shape (n, 3) or more columns"
        )
        raise malformed(path, "NPY", found)
    # Columns 4 to 6 of an array are its normals by common use; more are kept under their number.
    has_normals = loaded.shape[1] >= 6
    rest = range(6 if has_normals else 3, loaded.shape[1])
    return CloudFile(
        points=loaded[:, :3],
        normals=loaded[:, 3:6] if has_normals else None,
        attributes={f"column_{k + 1}": loaded[:, k] for k in rest},
        suffix=".npy",
    )


def _from_records(path: Path, loaded: Array) -> CloudFile:
    names = loaded.dtype.names or ()
    if any(axis not in names for axis in "xyz") or loaded.ndim != 1:
        raise malformed(path, "NPY", f"records of shape {loaded.shape} with {list(names)}, expected x, y, z")
    has_normals = all(name in names for name in ("nx", "ny", "nz"))
    used = {"x", "y", "z", *(("nx", "ny", "nz") if has_normals else ())}
    return CloudFile(
        points=np.stack([loaded[axis] for axis in "xyz"], axis=1),
        normals=np.stack([loaded[name] for name in ("nx", "ny", "nz")], axis=1) if has_normals else None,
        attributes={name: loaded[name] for name in names if name not in used},
        suffix=".npy",
        source="records",
    )


def _from_npz(path: Path, arrays: dict[str, Array]) -> CloudFile:
    found = [key for key in _POINT_KEYS if key in arrays]
    found = found or [key for key, values in arrays.items() if values.ndim == 2 and values.shape[1:] == (3,)]
    shapes = {key: values.shape for key, values in arrays.items()}
    if not found:
        raise malformed(path, "NPZ", f"no array 'points' of shape (n, 3), but {shapes}")
    points = arrays[found[0]]
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        raise malformed(
            path, "NPZ", f"{found[0]!r} is {points.dtype} of shape {points.shape}, expected (n, 3)"
        )
    normals = arrays.get("normals")
    attributes = {
        key: values
        for key, values in arrays.items()
        if key not in (found[0], "normals") and values.shape[:1] == (len(points),)
    }
    return CloudFile(
        points=points,
        normals=normals if normals is not None and normals.shape == points.shape else None,
        attributes=attributes,
        suffix=".npz",
        source=(found[0], arrays),
    )


def write(
    path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None
) -> None:
    """Write an NPY or NPZ file; see `face_plugin.io.write_cloud`."""
    if path.suffix.lower() == ".npz":
        key, arrays = cloud.source if cloud.suffix == ".npz" and cloud.source else ("points", {})
        normals = cloud.normals if normals is None else normals
        out = {**cloud.attributes, **extra, key: cloud.points}
        if normals is not None:
            out["normals"] = normals
        kept = {name: values if keep is None else values[keep] for name, values in out.items()}
        np.savez(path, allow_pickle=False, **{**arrays, **kept})
        return
    points, normals, attributes = columns(cloud, normals, extra, keep)
    if cloud.source == "records":
        named = {axis: points[:, k] for k, axis in enumerate("xyz")}
        if normals is not None:
            named.update({name: normals[:, k] for k, name in enumerate(("nx", "ny", "nz"))})
        named.update(attributes)
        records = np.empty(len(points), dtype=[(name, values.dtype) for name, values in named.items()])
        for name, values in named.items():
            records[name] = values
        np.save(path, records, allow_pickle=False)
        return
    blocks = [points] if normals is None else [points, normals]
    blocks += [values[:, None] for values in attributes.values() if values.dtype.kind in "fiub"]
    np.save(path, np.concatenate(blocks, axis=1), allow_pickle=False)
