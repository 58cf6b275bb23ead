"""The process that decodes a LAZ file for a trial: ``python -m (this module) FILE BYTES``."""

from __future__ import annotations

import contextlib
import importlib
import sys
from typing import Any


def limit_memory(size: int) -> None:
    """Let allocations beyond `size` bytes fail, where the system can do that."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        # What the interpreter and its libraries have mapped already does not count.
        with open("/proc/self/statm") as statm:
            mapped = int(statm.read().split()[0]) * resource.getpagesize()
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        wanted = size + mapped
        if soft == resource.RLIM_INFINITY or wanted < soft:
            resource.setrlimit(resource.RLIMIT_AS, (wanted, hard))
        # A crash is expected here, and its image of no use.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


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
