"""Signals that native libraries take away from Python, given back."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["same_signals"]

# Bytes that hold the system's description of what a signal does: 152 on Linux, 16 on macOS.
ACTION = 512


@contextmanager
def same_signals() -> Iterator[None]:
    """Leave what signals do as it was, whatever the block does to it; from any thread.

    Python's own `signal.signal` is for the main thread only, and does not see what a library has set.

    Examples
    --------
    >>> with same_signals():
    ...     pass
    """
    if os.name != "posix":
        yield
        return
    sigaction = ctypes.CDLL(None).sigaction
    sigaction.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
    before = {}
    for number in signal.valid_signals():
        action = ctypes.create_string_buffer(ACTION)
        if sigaction(number, None, action) == 0:
            before[number] = action
    try:
        yield
    finally:
        for number, action in before.items():
            sigaction(number, action, None)
