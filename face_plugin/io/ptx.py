"""PTX scans (Leica and others): grids of points in the scanner's frame, each with the scanner's pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from face_plugin.io.cloudfile import Array, CloudFile, malformed
from face_plugin.io.dialect import decoded
from face_plugin.io.names import COLOUR

# Columns and rows; the scanner's position and axes; a matrix of four rows.
_HEAD = 10


def read(path: Path) -> CloudFile:
    """Read a PTX file; see `face_plugin.io.read_cloud`. Grid places without a return are left out."""
    lines = [line for line in decoded(path, "PTX").splitlines() if line.strip()]
    points: list[Array] = []
    rest: list[Array] = []
    stations: list[Array] = []
    at = 0
    while at < len(lines):
        try:
            size, matrix = _pose(lines[at : at + _HEAD])
            if size > len(lines) - at - _HEAD:
                found = f"{size} points in the header, {len(lines) - at - _HEAD} lines follow: early end-of-file"
                raise ValueError(found)
            body = lines[at + _HEAD : at + _HEAD + size]
            table = np.loadtxt(body, dtype=np.float64, ndmin=2, comments=None) if size else np.empty((0, 4))
            if table.shape[1] < 3:
                raise ValueError(f"{table.shape[1]} numbers a point")
        except (ValueError, IndexError) as error:
            raise malformed(path, "PTX", f"scan {len(stations) + 1}: {error}") from error
        at += _HEAD + size
        # A place of the grid where nothing came back is written as the origin.
        table = table[table[:, :3].any(axis=1)]
        points.append(table[:, :3] @ matrix[:3, :3] + matrix[3, :3])
        rest.append(table[:, 3:])
        stations.append(matrix[3, :3])
    if not points:
        raise malformed(path, "PTX", "the file is empty")
    return CloudFile(
        points=np.concatenate(points),
        attributes=_attributes(rest),
        suffix=".ptx",
        viewpoints=np.array(stations),
    )


def _pose(head: list[str]) -> tuple[int, NDArray[np.float64]]:
    """Return the number of points and the matrix (4, 4) that row vectors are multiplied with."""
    if len(head) < _HEAD:
        raise ValueError("early end-of-file in its header")
    columns, rows = (int(line) for line in head[:2])
    if columns < 0 or rows < 0:
        raise ValueError(f"{columns} columns of {rows} points")
    values = [[float(word) for word in line.split()] for line in head[2:]]
    if [len(row) for row in values] != [3] * 4 + [4] * 4:
        raise ValueError(f"its header has rows of {[len(row) for row in values]} numbers, expected 4 of 3 and 4 of 4")
    return columns * rows, np.array(values[4:])


def _attributes(rest: list[Array]) -> dict[str, Array]:
    width = min(block.shape[1] for block in rest)
    table = np.concatenate([block[:, :width] for block in rest])
    out: dict[str, Array] = {}
    if width in (1, 4):
        out["intensity"] = table[:, 0]
    if width >= 3:
        out.update({name: table[:, width - 3 + k].astype(np.int64) for k, name in enumerate(COLOUR)})
    if len(rest) > 1:
        out["scan"] = np.repeat(np.arange(len(rest), dtype=np.int32), [len(block) for block in rest])
    return out
