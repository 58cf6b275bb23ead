"""Tiles of which a worker is killed at any moment, as if none had been: processes of this machine, and Dask's."""

from __future__ import annotations

import os
import signal
import threading
from functools import cache
from pathlib import Path

import numpy as np
import psutil

from face_plugin import Execution, FaceError, Result, estimate_normals, shapes

POINTS = shapes.sphere(4000).points


@cache
def expected() -> Result:
    return estimate_normals(POINTS, execution=Execution(tile_points=1000, engine="serial"))


def prepare() -> None:
    expected()


def children() -> set[int]:
    return {child.pid for child in psutil.Process().children() if "resource_tracker" not in " ".join(child.cmdline())}


def kill(number: int) -> None:
    """Kill one of the workers that there are at the moment."""
    try:
        pids = sorted(children())
        if pids:
            os.kill(pids[number % len(pids)], signal.SIGKILL)
    except (OSError, psutil.Error):  # it has just ended by itself
        return


def case(seed: int, folder: Path) -> str:
    rng = np.random.default_rng([seed, 7])
    engine = str(rng.choice(["processes", "dask"]))
    settings = Execution(tile_points=1000, engine=engine, workers=2)
    timers = [
        threading.Timer(float(rng.uniform(0, 4)), kill, (int(rng.integers(9)),)) for _ in range(rng.integers(1, 4))
    ]
    for timer in timers:
        timer.start()
    try:
        result = estimate_normals(POINTS, execution=settings)
    except FaceError as error:
        assert "memory" in str(error), str(error)
        return f"{engine}, too many lost"
    finally:
        for timer in timers:
            timer.cancel()
            timer.join()
    np.testing.assert_array_equal(result.normals, expected().normals)
    np.testing.assert_array_equal(result.confidence, expected().confidence)
    return f"{engine}, equal"
