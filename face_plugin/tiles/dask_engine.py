"""Tiles on Dask's workers, here or on other machines (extra ``dask``)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

from face_plugin.errors import FaceError, require
from face_plugin.execution import Job

__all__ = ["Dask"]

log = logging.getLogger(__name__)

# Times that a tile may be lost with its worker, or fail, before the run fails.
RETRIES = 5
ADVICE = "probably for lack of memory: lower Execution.tile_points, or give the workers more memory"
# Seconds without a tile done after which it is asked whether there are workers at all.
PATIENCE = 5.0
# Tiles handed to the scheduler at a time, for each thread of the workers: all would be a burden to it.
TILES_A_THREAD = 4


class Dask:
    """Tiles on Dask's workers; the scheduler sees their numbers alone.

    Parameters
    ----------
    client : distributed.Client or str, optional
        A client, or the address of a scheduler. By default the current client, or else a cluster of this
        machine for the duration of the run.
    workers : int
        Workers of that cluster.
    memory : int
        Bytes that each of them may take before it is restarted.
    """

    def __init__(self, client: Any | None, workers: int, memory: int) -> None:
        self._distributed: Any = require("distributed", extra="dask")
        self._given = client
        self._workers = workers
        self._memory = memory
        self._stack = ExitStack()
        self._client: Any = None
        self._cluster: Any = None

    def __enter__(self) -> Dask:
        given = self._given
        if given is None:
            given = self._current()
        if given is None:
            given = self._cluster = self._stack.enter_context(self._local())
        if isinstance(given, str) or not hasattr(given, "submit"):
            given = self._stack.enter_context(self._distributed.Client(given, set_as_default=False))
        self._client = given
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def _current(self) -> Any | None:
        try:
            return self._distributed.Client.current(allow_global=True)
        except ValueError:
            return None

    def _local(self) -> Any:
        # A thread a worker: a tile takes a core for itself.
        try:
            return self._distributed.LocalCluster(
                n_workers=self._workers,
                threads_per_worker=1,
                processes=True,
                memory_limit=self._memory,
                dashboard_address=None,
            )
        except RuntimeError as error:
            raise FaceError(f"Dask's workers on this machine did not start ({error}), {ADVICE}") from error

    def run(self, job: Job, folder: str, tiles: Sequence[int], done: Callable[[int], None]) -> None:
        """Run `job` on each tile, and call `done` with its number when it is finished.

        Raises
        ------
        FaceError
            A tile was lost with its worker again and again, or all workers of this machine were.
        """
        waiting = iter(tiles)
        threads = max(1, sum(self._client.nthreads().values()))
        running: set[Any] = set()

        def submit() -> None:
            for tile in waiting:
                # Not pure: a run that is repeated must look at the disk again, not at a result remembered.
                running.add(self._client.submit(job, folder, tile, pure=False, retries=RETRIES))
                return

        for _ in range(TILES_A_THREAD * threads):
            submit()
        try:
            while running:
                for future in self._finished(running):
                    running.discard(future)
                    done(future.result())
                    submit()
        except self._distributed.KilledWorker as error:
            raise FaceError(f"Dask lost the workers of a tile again and again ({error}), {ADVICE}") from error

    def _finished(self, running: set[Any]) -> set[Any]:
        """Wait until some are."""
        warned = False
        while True:
            try:
                with self._client.as_current():
                    return set(self._distributed.wait(running, timeout=PATIENCE, return_when="FIRST_COMPLETED").done)
            except TimeoutError:
                # One that is killed while it starts is not started again, and tasks wait for workers for ever.
                if self._cluster is not None and not self._cluster.workers:
                    raise FaceError(f"all of Dask's workers on this machine were lost, {ADVICE}") from None
                if not warned and not self._client.nthreads():
                    log.warning("Dask has no workers, %d tiles wait for some", len(running))
                    warned = True
