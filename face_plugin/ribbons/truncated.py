"""PLY files whose header promises more rows than follow: read as far as they go."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from plyfile import PlyElementParseError

from face_plugin.io import CloudFile, read_cloud

_CUT = ("early end-of-file", "early end-of-line")


def read_ply(path: Path) -> tuple[CloudFile, list[str]]:
    """Read a PLY file and report the rows that are missing.

    Raises
    ------
    ValueError
        The file is malformed in another way, or has no vertices.
    """
    try:
        return read_cloud(path), []
    except ValueError as error:
        cause = error.__cause__
        if not isinstance(cause, PlyElementParseError) or cause.message not in _CUT:
            raise
        short, rows = cause.element.name, int(cause.row or 0)
        if short == "vertex":
            # Faces stand after the vertices: without all of those there are none.
            raise
    content = path.read_bytes()
    end = content.index(b"end_header")
    header = content[:end].decode("ascii", "replace")
    promised = dict(re.findall(r"^element\s+(\S+)\s+(\d+)", header, re.MULTILINE))
    after = list(promised)[list(promised).index(short) :]
    for name in after:
        count = rows if name == short else 0
        header = re.sub(rf"^(element\s+{re.escape(name)}\s+)\d+", rf"\g<1>{count}", header, flags=re.MULTILINE)
    with tempfile.TemporaryDirectory() as folder:
        repaired = Path(folder) / path.name
        repaired.write_bytes(header.encode("ascii", "replace") + content[end:])
        cloud = read_cloud(repaired)
    return cloud, [f"the header promises {promised[short]} rows of {short!r}, the file has {rows}"]
