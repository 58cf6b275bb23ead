"""Several threads that work at a time, as one after the other."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from face_plugin import Execution, FaCE, estimate_normals, reconstruct, shapes
from face_plugin.io import CloudFile, read_cloud, write_cloud

SHAPES = (shapes.sphere, shapes.torus, shapes.teapot)


def prepare() -> None:
    reconstruct(shapes.sphere(2500).points, execution=Execution(tile_points=1250, engine="serial"), depth=4)


def case(seed: int, folder: Path) -> str:
    rng = np.random.default_rng([seed, 3])

    def job(k: int) -> Callable[[], np.ndarray]:
        points = SHAPES[rng.integers(len(SHAPES))](int(rng.integers(200, 500)), k).points
        backend = ("open3d", "pymeshlab")[rng.integers(2)]
        path = folder / f"{k}{rng.choice(['.ply', '.npy', '.las', '.xyz'])}"

        def files() -> np.ndarray:
            write_cloud(path, CloudFile(points), normals=points)
            return read_cloud(path).points

        tiles = Execution(tile_points=1000, engine="serial")
        jobs: list[Callable[[], np.ndarray]] = [
            lambda: estimate_normals(points).normals,
            lambda: estimate_normals(np.r_[points, points + 3, points + 6, points + 9], execution=tiles).normals,
            lambda: reconstruct(points, depth=4, backend=backend).vertices,
            lambda: FaCE(points).interior(),
            files,
        ]
        return jobs[rng.integers(len(jobs))]

    jobs = [job(k) for k in range(6)]
    expected = [run() for run in jobs]
    with ThreadPoolExecutor(6) as threads:
        found = [future.result() for future in [threads.submit(run) for run in jobs]]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)
    return "equal"
