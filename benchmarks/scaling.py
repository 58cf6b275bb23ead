"""Time by stage and peak memory against the number of points, in one piece and in tiles.

    python benchmarks/scaling.py --sizes 1000 5000 20000 50000 100000 --output out
    python benchmarks/scaling.py --sizes 20000 100000 --tiled 20000 100000 1000000 --workers 1 2 --output out

Every measurement runs in a process of its own. Figures go to scaling.json and a table, curves to scaling.png.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from clouds import teapot_with_box

# The stages of one piece; tiles add them up over all tiles.
STAGES = ("cloud", "coarse", "cage", "domain", "mesh", "poisson", "field", "normals", "refine")
SAMPLED_EVERY = 0.2
# Where the strength is lower, the side of a point inside follows from the last digits of a shielded field.
VISIBLE = 1e-6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="*", default=[1000, 5000, 20000, 50000, 100000])
    parser.add_argument("--tiled", type=int, nargs="*", default=[], help="sizes to solve in tiles")
    parser.add_argument("--workers", type=int, nargs="*", default=[2], help="processes for the tiles")
    parser.add_argument("--tile-points", type=int, default=40_000)
    parser.add_argument("--output", type=Path, default=Path("out"))
    parser.add_argument("--add", action="store_true", help="to the figures that scaling.json holds already")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.measure:
        measure(**json.loads(args.measure))
        return
    args.output.mkdir(parents=True, exist_ok=True)
    store = args.output / "scaling.json"
    records = json.loads(store.read_text()) if args.add and store.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        for n in sorted({*args.sizes, *args.tiled}):
            cloud = teapot_with_box(n)
            path = Path(folder) / f"{n}.npz"
            np.savez(path, points=cloud.points, normals=cloud.normals, interior=cloud.interior)
            jobs: list[dict[str, Any]] = [{}] if n in args.sizes else []
            if n in args.tiled:
                jobs += [{"tile_points": min(args.tile_points, n // 2), "workers": k} for k in args.workers]
            for job in jobs:
                records.append(in_a_process({"path": str(path), **job}))
                print(row(records[-1]), flush=True)
                store.write_text(json.dumps(records, indent=1))
            path.unlink()
            path.with_suffix(".one.npz").unlink(missing_ok=True)
    for line in fits(records):
        print(line)
    plot(records, args.output / "scaling.png")


def in_a_process(job: dict[str, Any]) -> dict[str, Any]:
    """Run a measurement, and watch the memory of all its processes."""
    child = subprocess.Popen(
        [sys.executable, __file__, "--measure", json.dumps(job)], stdout=subprocess.PIPE, text=True
    )
    peak = 0.0
    stop = threading.Event()

    def watch() -> None:
        nonlocal peak
        while not stop.wait(SAMPLED_EVERY):
            peak = max(peak, sum(proportional_memory(pid) for pid in family(child.pid)))

    watcher = threading.Thread(target=watch)
    watcher.start()
    out, _ = child.communicate()
    stop.set()
    watcher.join()
    if child.returncode:
        raise SystemExit(f"measurement failed: {job}")
    return {**json.loads(out.splitlines()[-1]), "peak_gb": peak / 1e9}


def family(pid: int) -> list[int]:
    """Return a process and all that descend from it."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return [pid]
    return [pid, *(member for child in children for member in family(int(child)))]


def proportional_memory(pid: int) -> float:
    """Return the bytes of a process, each page shared out among those that have it (Linux)."""
    try:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return float(line.split()[1]) * 1024
    except OSError:
        pass
    return 0.0


def measure(path: str, tile_points: int | None = None, workers: int | None = None) -> None:
    """Measure one run, and print it as the last line."""
    from face_plugin import Params, estimate_normals
    from face_plugin.shapes import sphere
    from face_plugin.tiles import estimate_tiled

    with np.load(path) as arrays:
        points, truth, interior = arrays["points"], arrays["normals"], arrays["interior"]
    if tile_points is None:
        # Loading the compiled code from its cache is not what is to be measured.
        estimate_normals(sphere(200).points)
        params = Params(tile_points=len(points))
    else:
        engine = "serial" if workers == 1 else "processes"
        params = Params(tile_points=tile_points, workers=workers, engine=engine)
    cpu, start = cpu_seconds(), time.perf_counter()
    result = (estimate_normals if tile_points is None else estimate_tiled)(points, params)
    seconds = time.perf_counter() - start
    right = np.einsum("ij,ij->i", result.normals, truth) > 0
    reference = Path(path).with_suffix(".one.npz")
    record = {
        "points": len(points),
        "tile_points": tile_points,
        "workers": workers,
        "seconds": seconds,
        "cpu_seconds": cpu_seconds() - cpu,
        "timings": result.timings,
        "aligned": float(right[~interior].mean()),
    }
    if tile_points is None:
        np.savez(reference, normals=result.normals, strength=result.strength)
    elif reference.exists():
        with np.load(reference) as one:
            same = np.einsum("ij,ij->i", one["normals"], result.normals) > 0
            visible = one["strength"] > VISIBLE
        record["same"] = float(same[~interior].mean())
        record["same_all"] = float(same.mean())
        record["same_visible"] = float(same[visible].mean())
    record["load"] = os.getloadavg()[1]
    print(json.dumps(record))


def cpu_seconds() -> float:
    """Processor time of this process and of those it waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def row(record: dict[str, Any]) -> str:
    """Return a line of the table."""
    how = "one piece" if record["tile_points"] is None else f"tiles, {record['workers']} proc."
    timings = {name: stage_seconds(record, name) for name in STAGES}
    stages = "  ".join(f"{name} {seconds:.1f}" for name, seconds in timings.items() if seconds > 0)
    same = ""
    if "same" in record:
        same = (
            f"  same as one piece: {100 * record['same']:.3f} % outside, {100 * record['same_visible']:.3f} % "
            f"where E > {VISIBLE:g}, {100 * record['same_all']:.3f} % of all"
        )
    return (
        f"{record['points']:>9,}  {how:<15}  {record['seconds']:8.1f} s  (cpu {record['cpu_seconds']:.1f})  "
        f"{record['peak_gb']:.2f} GB  aligned {100 * record['aligned']:.2f} %{same}  [{stages}]"
    )


def stage_seconds(record: dict[str, Any], stage: str) -> float:
    """Return the seconds of a stage: of all tiles together where there are any, else as they passed."""
    timings = record["timings"]
    return float(timings.get(f"tiles: {stage}", timings.get(stage, 0.0)))


def fits(records: list[dict[str, Any]]) -> list[str]:
    """Fit ``time = constant * points ** exponent`` from 20,000 points on; below, loading weighs too much."""
    lines = []
    for (tiled, workers), group in groups(records).items():
        large = [r for r in group if r["points"] > 15_000]
        if len(large) > 1:
            size = np.log([r["points"] for r in large])
            for name in ("seconds", "cpu_seconds", "peak_gb"):
                exponent = np.polyfit(size, np.log([r[name] for r in large]), 1)[0]
                label = f"tiles, {workers} processes" if tiled else "one piece"
                lines.append(f"{label}: {name} ~ points ** {exponent:.2f}")
    return lines


def groups(records: list[dict[str, Any]]) -> dict[tuple[bool, int | None], list[dict[str, Any]]]:
    """Return the records of a kind, in the order of their sizes."""
    found: dict[tuple[bool, int | None], list[dict[str, Any]]] = {}
    for record in sorted(records, key=lambda r: r["points"]):
        found.setdefault((record["tile_points"] is not None, record["workers"]), []).append(record)
    return found


def plot(records: list[dict[str, Any]], path: Path) -> None:
    """Draw time and memory against the number of points."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for (tiled, workers), group in groups(records).items():
        label = f"tiles, {workers} process{'es' if workers != 1 else ''}" if tiled else "one piece"
        size = [r["points"] for r in group]
        left.loglog(size, [r["seconds"] for r in group], "o-", label=label)
        right.loglog(size, [r["peak_gb"] for r in group], "o-", label=label)
        if not tiled:
            for stage in STAGES:
                seconds = [max(stage_seconds(r, stage), 1e-3) for r in group]
                left.loglog(size, seconds, "--", linewidth=0.8, label=stage)
    left.set(xlabel="points", ylabel="seconds", title="Time")
    right.set(xlabel="points", ylabel="GB, all processes", title="Peak memory")
    for axes in (left, right):
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=7)
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    main()
