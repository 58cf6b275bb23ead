"""Files that libraries unpack, LAZ and E57, with some bytes changed."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import files
import laspy
import numpy as np
import pye57
from io_files import POINTS


@cache
def laz() -> bytes:
    import io

    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [5e5, 6e5, 0]
    data = laspy.LasData(header)
    data.xyz = POINTS
    stream = io.BytesIO()
    data.write(stream, do_compress=True)
    return stream.getvalue()


def e57(folder: Path) -> bytes:
    path = folder / "whole.e57"
    with pye57.E57(str(path), mode="w") as file:
        file.write_scan_raw(
            {f"cartesian{axis}": np.ascontiguousarray(POINTS[:, k]) for k, axis in enumerate("XYZ")},
            translation=np.array([1.0, 2.0, 3.0]),
        )
    content = path.read_bytes()
    path.unlink()
    return content


def case(seed: int, folder: Path) -> str:
    rng = np.random.default_rng([seed, 6])
    if rng.random() < 0.5:
        return f"LAZ {files.read_mutated(folder / 'a.laz', laz(), rng)}"
    return f"E57 {files.read_mutated(folder / 'a.e57', e57(folder), rng)}"
