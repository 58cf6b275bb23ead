"""Stages of the work: timed, and reported as they begin and end."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

__all__ = ["Clock", "Progress", "Stage"]

log = logging.getLogger(__name__)

Progress = Callable[[str, float], None]
"""Called with the name of a stage and 0.0 at its start, 1.0 at its end."""
Stage = Callable[[str], AbstractContextManager[object]]
"""What a stage of the given name runs in, such as a `Clock`."""


class Clock:
    """Seconds by stage.

    Parameters
    ----------
    progress : callable, optional
        ``progress(stage, fraction)``.
    now : callable
        Tells the time in seconds: that which passes, or `time.process_time`.

    Examples
    --------
    >>> clock = Clock()
    >>> with clock("mesh"):
    ...     pass
    >>> list(clock.seconds)
    ['mesh']
    """

    def __init__(self, progress: Progress | None = None, now: Callable[[], float] = time.perf_counter) -> None:
        self.seconds: dict[str, float] = {}
        self._report = progress or (lambda stage, fraction: None)
        self._now = now

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Count what runs within for a stage; a stage that is entered again goes on."""
        self._report(stage, 0.0)
        start = self._now()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + self._now() - start
        log.debug("%s: %.3f s", stage, self.seconds[stage])
        self._report(stage, 1.0)
