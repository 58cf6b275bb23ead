"""LAS and LAZ point clouds through laspy (extra ``las``)."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from face_plugin.errors import require
from face_plugin.io.cloudfile import Array, CloudFile, columns, malformed
from face_plugin.io.lascheck import check_las
from face_plugin.io.names import COLOUR, with_colours

# The names under which PDAL and CloudCompare keep normals in extra bytes.
LAS_NORMAL = ("NormalX", "NormalY", "NormalZ")

ASKED = 1 << 20
"""Bytes written to a file that the compressor could not write to, to be told why."""


def read(path: Path) -> CloudFile:
    """Read a LAS or LAZ file; see `face_plugin.io.read_cloud`."""
    laspy = require("laspy", extra="las")
    try:
        check_las(path)
        las = laspy.read(str(path))
        points = np.ascontiguousarray(las.xyz)
    except OSError:
        raise
    except Exception as error:
        # laspy and its LAZ back ends raise many types on a broken file (their own, ValueError, struct.error,
        # Rust's): all of them mean that this is not a file of points.
        raise malformed(path, path.suffix[1:].upper(), error) from error
    names = list(las.point_format.dimension_names)
    has_normals = all(name in names for name in LAS_NORMAL)
    skip = {"X", "Y", "Z", *(LAS_NORMAL if has_normals else ())}
    return CloudFile(
        points=points,
        normals=np.stack([np.asarray(las[name]) for name in LAS_NORMAL], axis=1) if has_normals else None,
        attributes={name: np.asarray(las[name]) for name in names if name not in skip},
        suffix=path.suffix.lower(),
        source=las,
    )


def write(path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None) -> None:
    """Write a LAS or LAZ file; see `face_plugin.io.write_cloud`."""
    laspy = require("laspy", extra="las")
    points, normals, attributes = columns(cloud, normals, extra, keep)
    bad = len(points) - int(np.isfinite(points).all(axis=1).sum())
    if bad:
        # LAS stores integers, and what they would become is anything.
        raise ValueError(
            f"points: LAS holds finite coordinates only, found NaN or infinity in {bad} of {len(points)} rows"
        )
    if isinstance(cloud.source, laspy.LasData):
        # Indexing copies header and points; an empty mask would be taken for an empty list of names.
        mask = np.ones(len(cloud), dtype=bool) if keep is None else keep
        las = cloud.source[mask if len(mask) else slice(0, 0)]
        # The octree of a COPC file names places in that file.
        las.header.vlrs = [vlr for vlr in las.header.vlrs if vlr.user_id != "copc"]
        las.evlrs = [vlr for vlr in las.evlrs or [] if vlr.user_id != "copc"] or None
        new = {name: values for name, values in attributes.items() if name in extra}
    else:
        las = new_las(laspy, points)
        new = attributes if _has_wide_colours(attributes) else with_colours(attributes)
    if normals is not None:
        new = {**new, **{name: normals[:, k].astype(np.float32) for k, name in enumerate(LAS_NORMAL)}}
    present = set(las.point_format.dimension_names)
    added = [
        laspy.ExtraBytesParams(name=name[:32], type=np.uint8 if values.dtype.kind == "b" else values.dtype)
        for name, values in new.items()
        if name not in present and values.dtype.kind in "fiub"
    ]
    if added:
        las.add_extra_dims(added)
    present = set(las.point_format.dimension_names)
    for name, values in new.items():
        if name[:32] in present:
            las[name[:32]] = colour_16_bit(values) if name in COLOUR else values
    with las_writer(laspy, path, las.header) as out:
        out.write_points(las.points)
        if las.evlrs:
            out.write_evlrs(las.evlrs)


@contextmanager
def las_writer(laspy: ModuleType, path: Path, header: Any) -> Iterator[Any]:
    """Open a LAS or LAZ file to write points into."""
    # Sound files hold names of software in letters that LAS does not allow: the points are what counts.
    options = {"do_compress": path.suffix.lower() == ".laz", "encoding_errors": "replace", "closefd": False}
    with path.open("wb+") as stream:
        try:
            with laspy.open(stream, mode="w", header=header, **options) as writer:
                yield writer
        except Exception as error:
            if type(error).__name__ != "LazrsError":
                raise
            # The compressor does not say what the system told it, such as that the disk is full: more of the same does.
            stream.write(bytes(ASKED))
            stream.flush()
            raise OSError(errno.EIO, f"{os.strerror(errno.EIO)} ({error})") from error


def _has_wide_colours(attributes: Mapping[str, Array]) -> bool:
    return all(name in attributes and attributes[name].dtype == np.uint16 for name in COLOUR)


def colour_16_bit(values: Array) -> Array:
    """Colours in LAS have 16 bits; those of 8 bits are spread over them."""
    return values.astype(np.uint16) * 257 if values.dtype == np.uint8 else values


def new_las(laspy: ModuleType, points: Array) -> Any:
    """Make a LAS of point format 7 whose integer grid is as fine as the extent of the points allows."""
    low, extent = np.zeros(3), np.ones(3)
    if len(points):
        low, extent = points.min(axis=0).astype(np.float64), np.ptp(points, axis=0).astype(np.float64)
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.offsets = low
    # 2e9 steps fit 32 bits; a power of ten keeps decimal coordinates readable.
    header.scales = 10.0 ** np.ceil(np.log10(np.maximum(extent, 1e-300) / 2e9))
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T.astype(np.float64)
    return las
