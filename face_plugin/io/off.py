"""OFF meshes and clouds: vertices, with normals (NOFF) and colours (COFF) where they have them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, malformed
from face_plugin.io.dialect import decoded
from face_plugin.io.names import COLOUR, are_bytes

# Letters in any order, because programs differ; 4 and n (more dimensions) and BINARY are not read.
_MAGIC = re.compile(r"((?:ST|C|N)*)OFF(?!\s+BINARY)", re.IGNORECASE)


def read(path: Path) -> CloudFile:
    """Read an OFF file; see `face_plugin.io.read_cloud`."""
    text = decoded(path, "OFF")
    lines = [line for line in (raw.split("#", 1)[0].strip() for raw in text.splitlines()) if line]
    magic = _MAGIC.match(lines[0]) if lines else None
    if magic is None:
        raise malformed(path, "OFF", f"the first line is {lines[0][:40]!r}" if lines else "the file is empty")
    flags = magic[1].upper().replace("ST", "")
    # Counts may follow on the first line.
    rest = lines[0][magic.end() :].split()
    rows = lines[1:]
    if not rest:
        rest, rows = (rows[0].split(), rows[1:]) if rows else ([], [])
    try:
        count = int(rest[0])
        if not 0 <= count <= len(rows):
            raise ValueError(f"{count} vertices in the header, {len(rows)} lines follow: early end-of-file")
        table = np.loadtxt(rows[:count], dtype=np.float64, ndmin=2, comments=None) if count else np.empty((0, 3))
        if table.shape[1] < 3 + 3 * ("N" in flags):
            raise ValueError(f"{table.shape[1]} numbers a vertex")
    except (ValueError, IndexError) as error:
        raise malformed(path, "OFF", error) from error
    return _cloud(table, "N" in flags, "C" in flags)


def _cloud(table: Array, with_normals: bool, with_colours: bool) -> CloudFile:
    at = 3
    normals = None
    if with_normals:
        # The format puts normals before colours; MeshLab the four channels of a colour before normals.
        late = with_colours and table.shape[1] >= 10 and are_bytes([table[:, k] for k in range(3, 6)])
        normals = table[:, 7:10] if late else table[:, 3:6]
        at = 3 if late else 6
    attributes = {}
    if with_colours and table.shape[1] >= at + 3:
        colours = [table[:, at + k] for k in range(3)]
        if are_bytes(colours):
            colours = [channel.astype(np.int64) for channel in colours]
        attributes = dict(zip(COLOUR, colours, strict=True))
    return CloudFile(points=np.ascontiguousarray(table[:, :3]), normals=normals, attributes=attributes, suffix=".off")
