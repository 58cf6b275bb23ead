"""The standard streams, which may be closed, full, or read by a program that has gone."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

__all__ = ["Unfailing", "fill_closed", "guarded_stdout", "settle_stdout"]


class Unfailing:
    """A stream for messages: what cannot be written is dropped, as there is nowhere to say so.

    Examples
    --------
    >>> import io
    >>> stream = io.StringIO()
    >>> stream.close()
    >>> Unfailing(stream).write("lost")
    4
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write, or drop."""
        with suppress(OSError, ValueError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Flush, or drop: what stays in a buffer would fail again when Python ends, and change the exit code."""
        try:
            self._stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                _mute(self._stream)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def fill_closed() -> None:
    """Open those of the standard streams that are closed.

    The next file to be opened would get the number of one, and whatever is printed.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # Those below are open, so that it is this number that is given. One cannot write to the first two: a
            # result that nobody gets is an error, a message that nobody gets is not.
            os.open(os.devnull, os.O_WRONLY if number == 2 else os.O_RDONLY)
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w", closefd=False))


@contextmanager
def guarded_stdout() -> Iterator[Callable[[str], None]]:
    """Send everything that native libraries print to stderr; yield the only way to write to stdout.

    A C++ mesher that prints a line would otherwise make the JSON on stdout unreadable.
    """
    settle_stdout()
    real = os.dup(1)
    os.dup2(2, 1)
    written: list[str] = []
    try:
        yield written.append
    finally:
        with suppress(OSError):
            sys.stdout.flush()
        if os.name == "posix":
            # C keeps its own buffer, which must be emptied before stdout is itself again.
            ctypes.CDLL(None).fflush(None)
        os.dup2(real, 1)
        os.close(real)
        settle_stdout("".join(written))


def settle_stdout(text: str = "") -> None:
    """Write what is left to stdout; where its reader (`head`, say) has seen enough, drop it.

    Raises
    ------
    OSError
        It is closed or full; with "standard output" for a file name.
    """
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        _mute(sys.stdout)
    except OSError as error:
        _mute(sys.stdout)
        raise OSError(error.errno, error.strerror, "standard output") from error


def _mute(stream: TextIO) -> None:
    """Let a stream write to nowhere: what its buffer holds goes there, or Python would complain when it ends."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
    stream.flush()
