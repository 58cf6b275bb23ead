"""A line a stage, with the time it took; on a terminal the stage at work shows how far it is."""

from __future__ import annotations

import time
from typing import TextIO

__all__ = ["Progress"]

# Reports that say no new hundredth are many.
HUNDREDTHS = 100


class Progress:
    """Stages on a stream; where that is no terminal, each is written once, when it is done.

    Examples
    --------
    >>> import io
    >>> shown = Progress(io.StringIO())
    >>> shown.update("cage", 0.0)
    >>> shown.update("cage", 1.0)
    >>> shown.stream.getvalue().split()
    ['cage', '0.0', 's']
    """

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self._live = stream.isatty()
        self._began: dict[str, float] = {}
        self._stage, self._shown = "", ""

    def update(self, stage: str, fraction: float) -> None:
        """Take a report of the library: 0 at the start of a stage, 1 at its end."""
        if fraction <= 0 or stage not in self._began:
            self._began[stage] = time.perf_counter()
        if fraction >= 1:
            self.note(f"{stage:<10} {time.perf_counter() - self._began.pop(stage):6.1f} s")
        elif self._live:
            self._stage = stage
            self._show(f"{stage:<10} " + (f"{int(HUNDREDTHS * fraction):6d} %" if fraction > 0 else "   ..."))

    def note(self, line: str) -> None:
        """Write a line above the stage at work."""
        shown = self._shown
        self._show("")
        self.stream.write(line + "\n")
        self._show(shown if self._stage in self._began else "")
        self.stream.flush()

    def close(self) -> None:
        """Leave the line of a stage that was not finished as it stands."""
        if self._shown:
            self.stream.write("\n")
            self._shown = ""

    def _show(self, text: str) -> None:
        """Write over the line of the stage at work."""
        if text != self._shown:
            self.stream.write("\r" + " " * len(self._shown) + "\r" + text)
            self.stream.flush()
            self._shown = text
