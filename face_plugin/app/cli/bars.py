"""One progress bar a stage, with the time it took."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn
from rich.text import Text

__all__ = ["Bars"]


class _Seconds(ProgressColumn):
    """Time since the start of a stage; it stands still when the stage is done."""

    def render(self, task: Task) -> Text:
        """Return the text of the column."""
        seconds = (task.finished_time if task.finished else task.elapsed) or 0.0
        return Text(f"{seconds:6.1f} s", style="progress.elapsed")


class Bars:
    """Bars on stderr; where that is no terminal, they are written once, at the end."""

    def __init__(self, console: Console) -> None:
        columns = (TextColumn("{task.description:<10}"), BarColumn(bar_width=30), _Seconds())
        self._progress = Progress(*columns, console=console)
        self._tasks: dict[str, TaskID] = {}
        self._progress.start()

    def update(self, stage: str, fraction: float) -> None:
        """Take a report of the library: 0 at the start of a stage, 1 at its end."""
        if fraction <= 0 or stage not in self._tasks:
            # Without a total the bar pulses: most stages are one long call.
            self._tasks[stage] = self._progress.add_task(stage, total=None)
        if fraction > 0:
            self._progress.update(self._tasks[stage], total=1.0, completed=fraction)

    def close(self) -> None:
        """Leave the bars on the screen as they stand."""
        self._progress.stop()
