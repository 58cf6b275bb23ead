"""The process that decodes a LAZ file for a trial: ``python -m (this module) FILE BYTES``."""

from __future__ import annotations

import importlib
import sys
from typing import Any

from face_plugin.child import limit_memory


def main() -> None:
    """Read the file to its end; any failure ends the process with another code than 0."""
    path, size = sys.argv[1:]
    laspy: Any = importlib.import_module("laspy")
    limit_memory(int(size))
    seen = 0
    with laspy.open(path) as reader:
        for records in reader.chunk_iterator(1_000_000):
            seen += len(records)
        if seen < reader.header.point_count:
            raise ValueError(f"{seen} of {reader.header.point_count} points")


if __name__ == "__main__":
    main()
