"""Being told to stop. Little is imported here: Ctrl-C may come while the rest is still being loaded."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["STOPPED", "Terminated", "listening"]

STOPPED: dict[int, tuple[str, int]] = {
    signal.SIGINT: ("interrupted", 130),
    signal.SIGTERM: ("terminated", 143),
}
"""By signal: what is said, and the exit code."""


class Terminated(BaseException):
    """SIGTERM, as an exception: what is open is closed and temporary files are removed."""


@contextmanager
def listening() -> Iterator[list[int]]:
    """Let SIGINT and SIGTERM raise; yield the list of those that came.

    Libraries that are interrupted while they load make other exceptions of it, and Python drops those that are raised
    while it frees an object: the list tells.
    """
    heard: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        # Only the main thread can be told of signals.
        yield heard
        return

    def stop(number: int, frame: FrameType | None) -> None:
        heard.append(number)
        raise KeyboardInterrupt if number == signal.SIGINT else Terminated

    def dropped(info: sys.UnraisableHookArgs) -> None:
        if not isinstance(info.exc_value, (KeyboardInterrupt, Terminated)):
            hook(info)

    hook, sys.unraisablehook = sys.unraisablehook, dropped
    previous = {signal.SIGTERM: signal.signal(signal.SIGTERM, stop)}
    # Shells start what runs in the background with interrupts ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        previous[signal.SIGINT] = signal.signal(signal.SIGINT, stop)
    try:
        yield heard
    finally:
        sys.unraisablehook = hook
        for number, handler in previous.items():
            signal.signal(number, handler)
