"""STL meshes, binary and ascii: the corners of their facets, equal ones once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, malformed

STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_START = 84
_VERTEX = re.compile(rb"^\s*vertex\s+(\S+)\s+(\S+)\s+(\S+)\s*$", re.IGNORECASE | re.MULTILINE)


def read(path: Path) -> CloudFile:
    """Read an STL file; see `face_plugin.io.read_cloud`."""
    content = path.read_bytes()
    try:
        corners = _binary(content)
        if corners is None:
            corners = _text(content)
    except ValueError as error:
        raise malformed(path, "STL", error) from error
    # Each facet repeats its corners; as points they count once, in the order of their first mention.
    _, first = np.unique(corners, axis=0, return_index=True)
    return CloudFile(points=corners[np.sort(first)], suffix=".stl")


def _binary(content: bytes) -> Array | None:
    """Corners (k, 3) of a binary file; None for text."""
    if len(content) < _START:
        return None
    count = int(np.frombuffer(content, "<u4", 1, _START - 4)[0])
    size = _START + count * STL_FACET.itemsize
    # Text begins with "solid", but so do some binary files: the size decides.
    if len(content) < size or not count:
        if content.lstrip()[:5].lower() == b"solid" and b"\0" not in content:
            return None
        raise ValueError(f"{count} facets need {size} bytes, the file has {len(content)}: early end-of-file")
    facets = np.frombuffer(content, STL_FACET, count, _START)
    return facets["corners"].reshape(-1, 3).astype(np.float32)


def _text(content: bytes) -> Array:
    if content.lstrip()[:5].lower() != b"solid":
        raise ValueError("neither 'solid' at its beginning nor a binary header")
    rows = [b" ".join(words) for words in _VERTEX.findall(content)]
    if not rows:
        raise ValueError("no line 'vertex x y z'")
    return np.loadtxt(rows, dtype=np.float64, ndmin=2, comments=None)
