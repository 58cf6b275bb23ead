"""What `face` says: progress and messages on stderr, the result on stdout."""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import Any

from face_plugin.app.cli.progress import Progress

__all__ = ["Console"]


class Console:
    """Progress, log messages and the closing summary of one run."""

    def __init__(self, command: str, verbose: bool, quiet: bool, as_json: bool, write: Callable[[str], None]) -> None:
        self.command, self.verbose, self.quiet, self.as_json = command, verbose, quiet, as_json
        self._write = write
        self._start = time.perf_counter()
        self._progress = Progress(sys.stderr)
        self.heard: list[int] = []

    def __enter__(self) -> Console:
        """Start to show log messages and warnings."""
        self._handler = _Handler(self.note)
        self._loggers = [logging.getLogger("face_plugin"), logging.getLogger("py.warnings")]
        level = logging.ERROR if self.quiet else logging.DEBUG if self.verbose else logging.WARNING
        self._levels = [logger.level for logger in self._loggers]
        for logger in self._loggers:
            logger.addHandler(self._handler)
            logger.setLevel(level)
        # That code is being compiled is worth a line: nothing else happens for seconds.
        self._compiling = logging.getLogger("face_plugin.compiled")
        self._compiling.setLevel(logging.ERROR if self.quiet else logging.INFO)
        logging.captureWarnings(True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the progress as it stands and give logging back."""
        self._progress.close()
        logging.captureWarnings(False)
        for logger, level in zip(self._loggers, self._levels, strict=True):
            logger.removeHandler(self._handler)
            logger.setLevel(level)
        self._compiling.setLevel(logging.NOTSET)

    def progress(self, stage: str, fraction: float) -> None:
        """Show a stage: the callback that the library takes."""
        if self.heard:
            # It was told to stop, and the exception that should have done it was dropped.
            raise KeyboardInterrupt
        if self.quiet:
            return
        self._progress.update(stage, fraction)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Show a step of the command itself, such as writing a file."""
        self.progress(name, 0.0)
        yield
        self.progress(name, 1.0)

    def note(self, message: str) -> None:
        """Write a line to stderr, above the stage at work."""
        self._progress.note(message.rstrip("\n"))

    def report(self, summary: Mapping[str, Any], text: str) -> None:
        """Say what was done: JSON where it was asked for, else one or more lines of text."""
        self._progress.close()
        seconds = time.perf_counter() - self._start
        if self.as_json:
            full = {"command": self.command, **summary, "seconds": round(seconds, 3), **_peak_memory()}
            self._write(json.dumps(full, default=_plain) + "\n")
        elif not self.quiet:
            self._write(text + "\n")

    def fail(self, message: str, code: int) -> int:
        """Say what went wrong and return the exit code."""
        self._progress.close()
        self.note(f"face: error: {message}")
        if self.as_json:
            self._write(json.dumps({"command": self.command, "error": message, "exit_code": code}) + "\n")
        return code


class _Handler(logging.Handler):
    def __init__(self, note: Callable[[str], None]) -> None:
        super().__init__()
        self._note = note

    def emit(self, record: logging.LogRecord) -> None:
        self._note(f"face: {record.levelname.lower()}: {record.getMessage()}")


def _plain(value: Any) -> Any:
    """Turn what JSON does not know (NumPy numbers, paths) into what it does."""
    return value.item() if hasattr(value, "item") else str(value)


def _peak_memory() -> dict[str, float]:
    try:
        import resource
    except ImportError:  # Windows
        return {}
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Linux counts in KiB, macOS in bytes.
    return {"peak_memory_mib": round(peak / (2**20 if sys.platform == "darwin" else 2**10), 1)}
