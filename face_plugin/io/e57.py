"""E57 scans through pye57 (extra ``e57``): all scans in one frame, their poses as viewpoints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from face_plugin.errors import require
from face_plugin.io.cloudfile import Array, CloudFile, malformed

_NAMES = {"colorRed": "red", "colorGreen": "green", "colorBlue": "blue", "intensity": "intensity"}
_AXES = ("cartesianX", "cartesianY", "cartesianZ")
# The densest packing of a point that the format knows is a bit in each of its pages of 1020 bytes; a claim
# beyond a point a bit of the file is a damaged header.
_BITS = 8


def read(path: Path) -> CloudFile:
    """Read an E57 file; see `face_plugin.io.read_cloud`."""
    pye57: Any = require("pye57", extra="e57")
    size = path.stat().st_size
    scans: list[dict[str, Array]] = []
    stations: list[Array] = []
    try:
        with pye57.E57(str(path)) as source:
            for k in range(source.scan_count):
                header = source.get_header(k)
                if header.point_count > _BITS * size:
                    raise ValueError(f"scan {k} claims {header.point_count} points in a file of {size} bytes")
                fields = set(header.point_fields)
                scan = source.read_scan(
                    k,
                    intensity="intensity" in fields,
                    colors={"colorRed", "colorGreen", "colorBlue"} <= fields,
                    ignore_missing_fields=True,
                )
                scans.append(scan)
                if header.has_pose():
                    stations.append(np.asarray(header.translation, dtype=np.float64))
    except OSError:
        raise
    except Exception as error:
        # libE57's exceptions have no common base in Python; all of them mean a damaged file.
        raise malformed(path, "E57", error) from error
    if not scans:
        raise malformed(path, "E57", "no scan in it")
    attributes = {
        name: np.concatenate([scan[field] for scan in scans])
        for field, name in _NAMES.items()
        if all(field in scan for scan in scans)
    }
    lengths = [len(scan[_AXES[0]]) for scan in scans]
    if len(scans) > 1:
        attributes["scan"] = np.repeat(np.arange(len(scans), dtype=np.int32), lengths)
    return CloudFile(
        points=np.concatenate([np.stack([scan[axis] for axis in _AXES], axis=1) for scan in scans]),
        attributes=attributes,
        suffix=".e57",
        viewpoints=np.array(stations) if stations else None,
    )
