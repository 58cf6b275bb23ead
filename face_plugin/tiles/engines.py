"""Who solves the tiles: this process, other processes of this machine, or Dask's workers.

An engine gets a function, its first argument and the numbers of the tiles. The function writes its outcome
into the store and may be called again for the same tile, so that an engine only has to see to it that every
tile is done.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext
from typing import Any

from face_plugin.errors import FaceError
from face_plugin.execution import Engine, Job
from face_plugin.threads import one_core
from face_plugin.tiles.tile import warm_up

__all__ = ["Engine", "Job", "Processes", "Serial"]

log = logging.getLogger(__name__)

# Losses of workers in a row, without a single tile done between, after which a run gives up.
MOST_LOSSES = 3


class Serial:
    """One tile after the other in this process."""

    def __enter__(self) -> Serial:
        return self

    def __exit__(self, *error: object) -> None:
        return None

    def run(self, job: Job, folder: str, tiles: Sequence[int], done: Callable[[int], None]) -> None:
        """Run `job` on each tile, and call `done` with its number when it is finished."""
        for tile in tiles:
            done(job(folder, tile))


class Processes:
    """Tiles in parallel in processes of this machine.

    Lost processes (killed, or out of memory) are replaced, by one fewer each time that not a single tile
    came through; the script that calls this needs no ``if __name__ == "__main__"``.

    Parameters
    ----------
    workers : int
        Tiles at a time.
    takes_part : bool
        Whether this process solves tiles as well, so that one fewer has to start. It cannot be replaced if it
        dies, and reports what others have done between its own tiles: good where there is about one each.
    """

    def __init__(self, workers: int, *, takes_part: bool = False) -> None:
        self.workers = workers
        self.takes_part = takes_part and workers > 1
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Processes:
        self._start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop()

    def run(self, job: Job, folder: str, tiles: Sequence[int], done: Callable[[int], None]) -> None:
        """Run `job` on each tile, and call `done` with its number when it is finished.

        Raises
        ------
        FaceError
            Processes died again and again.
        """
        left, losses = list(tiles), 0
        while left:
            before = len(left)
            try:
                self._run_once(job, folder, left, done)
            except BrokenProcessPool:
                losses = 0 if len(left) < before else losses + 1
                if losses == MOST_LOSSES:
                    raise FaceError(
                        f"processes that solve tiles died {losses} times in a row, {len(left)} tiles left, "
                        "probably for lack of memory: lower Execution.tile_points or Execution.max_memory"
                    ) from None
                self.workers = max(1, self.workers - (losses > 0))
                log.warning("a process died; going on with %d tiles and %d workers", len(left), self.workers)
                self._stop()
                self._start()

    def _run_once(self, job: Job, folder: str, left: list[int], done: Callable[[int], None]) -> None:
        """Run what is left, and take it off the list as it gets done."""
        assert self._pool is not None
        # A few more than there are workers: a broken pool then has little to repeat, and Ctrl-C little to
        # cancel.
        most = self.workers - 1 if self.takes_part else self.workers + 1
        waiting, running = iter(list(left)), set[Future[int]]()

        def finish(tile: int) -> None:
            left.remove(tile)
            done(tile)

        while True:
            with _without_main():
                while len(running) < most and (tile := next(waiting, None)) is not None:
                    running.add(self._pool.submit(job, folder, tile))
            if self.takes_part and (tile := next(waiting, None)) is not None:
                finish(job(folder, tile))
            if not running:
                return
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                finish(future.result())

    def _start(self) -> None:
        count = max(1, self.workers - self.takes_part)
        # A copy of this process has all libraries at once, a new one loads them for a second.
        forks = _may_fork()
        self._pool = ProcessPoolExecutor(
            count,
            mp_context=multiprocessing.get_context("fork" if forks else "spawn"),
            initializer=_begin_worker,
        )
        # What is not loaded yet, they load while this process prepares the tiles.
        with nullcontext() if forks else _without_main():
            for _ in range(count):
                self._pool.submit(warm_up)

    def _stop(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None


def _may_fork() -> bool:
    """Whether copies of this process work: it has no threads but those of OpenBLAS, which ends them before a fork.

    The threads of others would be missing in a copy, and what they held locked would stay so.
    """
    if sys.platform != "linux" or threading.active_count() > 1:
        return False
    try:
        with warnings.catch_warnings():
            # That there may be such threads is what a first copy, which ends at once, is to tell.
            warnings.simplefilter("ignore", DeprecationWarning)
            copy = os.fork()
        if copy == 0:
            os._exit(0)
        os.waitpid(copy, 0)
        return len(os.listdir("/proc/self/task")) == 1
    except OSError:
        return False


def _begin_worker() -> None:
    one_core()
    _follow_parent()


def _follow_parent() -> None:
    """End this process when its parent does: one that is killed cannot say so, and would be waited for for ever."""
    parent = multiprocessing.parent_process()

    def follow() -> None:
        assert parent is not None
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


_main_lock = threading.Lock()


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the main module while processes start.

    A spawned process imports the main module of its parent, which would run a script a second time if it has
    no ``if __name__ == "__main__"``. Jobs are functions of this package and need nothing from there.
    """
    main: Any = sys.modules["__main__"]
    hidden = {}
    with _main_lock:
        for name in ("__spec__", "__file__"):
            if hasattr(main, name):
                hidden[name] = getattr(main, name)
        try:
            main.__spec__ = None
            if "__file__" in hidden:
                del main.__file__
            yield
        finally:
            for name, value in hidden.items():
                setattr(main, name, value)
