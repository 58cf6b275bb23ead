"""Speed against Open3D: its normals, and the Poisson reconstruction that follows, as ratios of one run.

    python benchmarks/speed.py
    python benchmarks/speed.py --sizes 20000 --shapes torus cup --repeats 5
    python benchmarks/speed.py --plot docs/speed.png

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
from pathlib import Path

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


def draw(sizes: list[int], ratios: dict[str, list[tuple[float, float]]], path: Path) -> None:
    """Draw FaCE's time over that of each of the two, against the number of points."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    titles = ("Open3D's estimate + consistent tangent planes", "screened Poisson reconstruction, depth 8")
    for column, (axes, title) in enumerate(zip(figure.subplots(1, 2, sharey=True), titles, strict=True)):
        for shape, pairs in ratios.items():
            axes.plot(sizes, [pair[column] for pair in pairs], marker="o", label=shape)
        axes.axhline(1.0, color="0.6", linewidth=1)
        axes.set(xscale="log", yscale="log", xlabel="points", title=f"FaCE's time, in that of\n{title}")
        axes.set_yticks([0.25, 0.5, 1, 2, 4], ["1/4", "1/2", "1", "2", "4"], minor=False)
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--sizes", type=int, nargs="+", default=[1000, 5000, 20_000, 100_000])
    parser.add_argument("--shapes", nargs="+", default=["torus", "teapot"], help="functions of face_plugin.shapes")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--plot", type=Path, help="draw the ratios into this PNG")
    parser.add_argument("--first-call", action="store_true", help="print one cold call as JSON, in this very process")
    args = parser.parse_args()
    if args.first_call:
        first_call(args.shapes[0], args.sizes[0])
        return
    from face_plugin import shapes

    head = ["Open3D normals, s", "FaCE, s", "PSR, s", "FaCE : Open3D", "FaCE : PSR"]
    rows = [f"| cloud | points | {' | '.join(head)} |", f"|---|{'---|' * (len(head) + 1)}"]
    parts = [f"| cloud | points | | {' | '.join(STAGES)} | all |", f"|---|---|---|{'---|' * (len(STAGES) + 1)}"]
    ratios: dict[str, list[tuple[float, float]]] = {shape: [] for shape in args.shapes}
    for shape in args.shapes:
        for size in args.sizes:
            (host, ours, surface), least = warm(getattr(shapes, shape)(size).points, args.repeats)
            name = f"| {shape} | {size:,} |"
            rows.append(f"{name} {host:.2f} | {ours:.2f} | {surface:.2f} | {ours / host:.2f} | {ours / surface:.2f} |")
            ratios[shape].append((ours / host, ours / surface))
            first = cold(shape, size)
            for kind, spent in (("warm", {**least, "all": sum(least.values())}), ("cold", first)):
                parts.append(f"{name} {kind} | {' | '.join(f'{spent[stage]:.2f}' for stage in (*STAGES, 'all'))} |")
    if args.plot is not None:
        draw(args.sizes, ratios, args.plot)
    print("\nSeconds, and ratios:\n", *rows, "\nProcessor seconds; cold with imports:\n", *parts, sep="\n")


if __name__ == "__main__":
    main()
