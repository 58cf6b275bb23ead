"""Speed against Open3D: its normals, and the Poisson reconstruction that follows, as ratios of one run.

    python benchmarks/speed.py
    python benchmarks/speed.py --sizes 20000 --shapes torus cup --repeats 5

Each size is timed in turn: `estimate_normals()` + `orient_normals_consistent_tangent_plane(15)`, FaCE's normals, and
screened Poisson reconstruction of depth 8 from these; the least of the repeats counts. Then a process of its own with
an empty folder for compiled code takes the first call after an installation. Prints Markdown: seconds that passed, for
the ratios, and processor seconds by stage, which other work on the machine changes less.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

STAGES = ("cloud", "cage", "domain", "mesh", "poisson", "field", "normals")
Array = NDArray[np.float64]


def open3d_normals(points: Array) -> None:
    """Run what a script without FaCE does."""
    import open3d as o3d

    pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    pcd.estimate_normals()
    pcd.orient_normals_consistent_tangent_plane(15)


def stages(points: Array) -> tuple[Array, dict[str, float]]:
    """Get FaCE's normals, and the processor seconds of each stage on the way."""
    import face_plugin

    spent = dict.fromkeys(STAGES, 0.0)

    def progress(stage: str, fraction: float) -> None:
        spent[stage] = spent.get(stage, 0.0) + (time.process_time() if fraction else -time.process_time())

    return np.asarray(face_plugin.FaCE(points, progress=progress).normals()), spent


def passed(call: Callable[[], object]) -> float:
    """Seconds that a call takes."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def warm(points: Array, repeats: int) -> tuple[list[float], dict[str, float]]:
    """Least seconds of Open3D's normals, of FaCE's and of the reconstruction; least processor seconds by stage."""
    from face_plugin.surface import poisson_reconstruction

    normals, least = stages(points)
    runs = []
    for _ in range(repeats):
        host = passed(lambda: open3d_normals(points))
        start = time.perf_counter()
        normals, spent = stages(points)
        ours = time.perf_counter() - start
        surface = passed(lambda: poisson_reconstruction(points, normals, depth=8, backend="open3d"))  # noqa: B023
        runs.append((host, ours, surface))
        least = {stage: min(least[stage], spent[stage]) for stage in STAGES}
    return [min(run[k] for run in runs) for k in range(3)], least


def cold(shape: str, size: int) -> dict[str, float]:
    """Processor seconds by stage of the first call after an installation, imports among them."""
    with tempfile.TemporaryDirectory() as empty:
        command = [sys.executable, __file__, "--first-call", "--shapes", shape, "--sizes", str(size)]
        done = subprocess.run(
            command, env=os.environ | {"NUMBA_CACHE_DIR": empty}, stdout=subprocess.PIPE, text=True, check=True
        )
    found: dict[str, float] = json.loads(done.stdout)
    return found


def first_call(shape: str, size: int) -> None:
    """Print what `cold` reads; making the shape does not count."""
    from face_plugin import shapes

    made = time.process_time()
    points = getattr(shapes, shape)(size).points
    made = time.process_time() - made
    spent = stages(points)[1]
    print(json.dumps({**spent, "all": time.process_time() - made}))


def main() -> None:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--sizes", type=int, nargs="+", default=[1000, 5000, 20_000, 100_000])
    parser.add_argument("--shapes", nargs="+", default=["torus", "teapot"], help="functions of face_plugin.shapes")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--first-call", action="store_true", help="print one cold call as JSON, in this very process")
    args = parser.parse_args()
    if args.first_call:
        first_call(args.shapes[0], args.sizes[0])
        return
    from face_plugin import shapes

    head = ["Open3D normals, s", "FaCE, s", "PSR, s", "FaCE : Open3D", "FaCE : PSR"]
    rows = [f"| cloud | points | {' | '.join(head)} |", f"|---|{'---|' * (len(head) + 1)}"]
    parts = [f"| cloud | points | | {' | '.join(STAGES)} | all |", f"|---|---|---|{'---|' * (len(STAGES) + 1)}"]
    for shape in args.shapes:
        for size in args.sizes:
            (host, ours, surface), least = warm(getattr(shapes, shape)(size).points, args.repeats)
            name = f"| {shape} | {size:,} |"
            rows.append(f"{name} {host:.2f} | {ours:.2f} | {surface:.2f} | {ours / host:.2f} | {ours / surface:.2f} |")
            first = cold(shape, size)
            for kind, spent in (("warm", {**least, "all": sum(least.values())}), ("cold", first)):
                parts.append(f"{name} {kind} | {' | '.join(f'{spent[stage]:.2f}' for stage in (*STAGES, 'all'))} |")
    print("\nSeconds, and ratios:\n", *rows, "\nProcessor seconds; cold with imports:\n", *parts, sep="\n")


if __name__ == "__main__":
    main()
