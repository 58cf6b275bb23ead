r"""Time by stage, memory and accuracy against the number of points, in one piece and in tiles.

    python benchmarks/scaling.py --sizes 1000 5000 20000 50000 100000 --output out
    python benchmarks/scaling.py --sizes 20000 100000 200000 --tiled 20000 100000 200000 500000 1000000 2000000 \
        --workers 1 2 --each-up-to 100000 --output out
    python benchmarks/scaling.py --sizes 20000 100000 --tiled 20000 100000 --clean --add --output out
    python benchmarks/scaling.py --from-file 1000000 --max-memory 0.4

Every measurement runs in a process of its own. Figures go to scaling.json and a table, curves to scaling.png, and what
follows for more points and machines is computed by `scaling_model.py` from scaling.json.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from clouds import teapot_with_box
from numpy.typing import NDArray
from scaling_report import compare, fits, plot, row

from face_plugin.io.plyread import read_data

SAMPLED_EVERY = 0.5
# Where the strength is lower, the side of a point inside follows from the last digits of a shielded field.
VISIBLE = 1e-6
# A point lies at the border of its tile where one of so many neighbours of another tile is within two spacings.
NEIGHBOURS = 24
BORDER = 2.0
# Points drawn for each one that is left where those inside are left out.
OUTSIDE = 1.5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="*", default=[1000, 5000, 20000, 50000, 100000])
    parser.add_argument("--tiled", type=int, nargs="*", default=[], help="sizes to solve in tiles")
    parser.add_argument("--workers", type=int, nargs="*", default=[2], help="processes for the tiles")
    parser.add_argument("--each-up-to", type=int, default=10**9, help="larger sizes: the last of --workers only")
    parser.add_argument("--tile-points", type=int, default=40_000)
    parser.add_argument("--clean", action="store_true", help="leave out the points inside")
    parser.add_argument("--output", type=Path, default=Path("out"))
    parser.add_argument("--add", action="store_true", help="to the figures that scaling.json holds already")
    parser.add_argument("--from-file", type=int, help="only this: `face normals` on a file of so many points")
    parser.add_argument("--max-memory", type=float, default=0.4, help="GB that it may take")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.from_file:
        print(from_file(args.from_file, args.max_memory))
        return
    if args.measure:
        measure(**json.loads(args.measure))
        return
    args.output.mkdir(parents=True, exist_ok=True)
    store = args.output / "scaling.json"
    records = json.loads(store.read_text()) if args.add and store.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        for n in sorted({*args.sizes, *args.tiled}):
            path = Path(folder) / f"{n}.npz"
            write_cloud(path, n, clean=args.clean)
            jobs: list[dict[str, Any]] = [{}] if n in args.sizes else []
            if n in args.tiled:
                workers = args.workers if n <= args.each_up_to else args.workers[-1:]
                jobs += [{"tile_points": min(args.tile_points, n // 2), "workers": k} for k in workers]
            for job in jobs:
                shape = "clean" if args.clean else "interiors"
                records.append({"shape": shape, **in_a_process({"path": str(path), **job})})
                print(row(records[-1]), flush=True)
                store.write_text(json.dumps(records, indent=1))
            path.unlink()
            path.with_suffix(".one.npz").unlink(missing_ok=True)
    for line in [*fits(records), *compare(records)]:
        print(line)
    plot(records, args.output / "scaling.png")


def write_cloud(path: Path, n: int, *, clean: bool) -> None:
    """Write a cloud of about n points and what is true of them."""
    cloud = teapot_with_box(round(OUTSIDE * n) if clean else n)
    kept = ~cloud.interior if clean else np.ones(len(cloud.points), dtype=np.bool_)
    np.savez(path, points=cloud.points[kept], normals=cloud.normals[kept], interior=cloud.interior[kept])


def in_a_process(job: dict[str, Any]) -> dict[str, Any]:
    """Run a measurement, and watch the memory of all its processes."""
    out, peaks = watched([sys.executable, __file__, "--measure", json.dumps(job)])
    return {**json.loads(out.splitlines()[-1]), **peaks}


def watched(command: list[str]) -> tuple[str, dict[str, float]]:
    """Run a command; what it printed, and the peaks of the memory of all its processes."""
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    peaks = {"peak_gb": 0.0, "parent_gb": 0.0, "worker_gb": 0.0}
    stop = threading.Event()

    def watch() -> None:
        while not stop.wait(SAMPLED_EVERY):
            parent, *workers = (proportional_memory(pid) / 1e9 for pid in family(child.pid))
            now = {"peak_gb": parent + sum(workers), "parent_gb": parent, "worker_gb": max(workers, default=0.0)}
            peaks.update({name: max(peaks[name], value) for name, value in now.items()})

    watcher = threading.Thread(target=watch)
    watcher.start()
    out, _ = child.communicate()
    stop.set()
    watcher.join()
    if child.returncode:
        raise SystemExit(f"failed: {' '.join(command)}")
    return out, peaks


def from_file(n: int, max_memory: float) -> str:
    """Run `face normals` from file to file on a cloud that need not fit into the memory allowed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_cloud(folder / "truth.npz", n, clean=False)
        with np.load(folder / "truth.npz") as arrays, open(folder / "big.ply", "wb") as file:
            axes = "".join(f"property double {axis}\n" for axis in "xyz")
            head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(arrays['points'])}\n{axes}end_header\n"
            file.write(head.encode())
            arrays["points"].astype("<f8").tofile(file)
        face = [sys.executable, "-m", "face_plugin.app.cli", "normals", str(folder / "big.ply")]
        start, spent = time.perf_counter(), processor_seconds()
        _, peaks = watched([*face, "-o", str(folder / "normals.ply"), "--max-memory", str(max_memory)])
        seconds, spent = time.perf_counter() - start, processor_seconds() - spent
        vertex = read_data(folder / "normals.ply", mapped=True)["vertex"].data
        normals = np.stack([vertex[axis] for axis in ("nx", "ny", "nz")], axis=1)
        with np.load(folder / "truth.npz") as arrays:
            right = np.einsum("ij,ij->i", normals, arrays["normals"])[~arrays["interior"]] > 0
    return (
        f"{len(normals):,} points with --max-memory {max_memory}: {seconds:.0f} s on the clock, {spent:.0f} s "
        f"of processors, {peaks['peak_gb']:.2f} GB at the peak of all processes, "
        f"{100 * right.mean():.3f} % on the right side"
    )


def processor_seconds() -> float:
    """Seconds of processors that all ended children, and theirs, have taken."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def family(pid: int) -> list[int]:
    """Return a process and all that descend from it."""
    try:
        threads = list(Path(f"/proc/{pid}/task").iterdir())
        children = [child for thread in threads for child in (thread / "children").read_text().split()]
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
    from face_plugin import Execution, estimate_normals
    from face_plugin.shapes import sphere

    with np.load(path) as arrays:
        points, truth, interior = arrays["points"], arrays["normals"], arrays["interior"]
    # Loading the compiled code from its cache is not what is to be measured; workers load theirs in the run.
    estimate_normals(sphere(200).points)
    reference = Path(path).with_suffix(".one.npz")
    cpu, own, start = cpu_seconds(), time.process_time(), time.perf_counter()
    if tile_points is None:
        result = estimate_normals(points, execution=Execution(tile_points=len(points)))
        normals, timings, tile, record = result.normals, result.timings, None, {}
    else:
        normals, timings, tile, record = solve_in_tiles(points, tile_points, workers)
    record |= {
        "own_cpu_seconds": time.process_time() - own,
        "points": len(points),
        "tile_points": tile_points,
        "workers": workers,
        "seconds": time.perf_counter() - start,
        "cpu_seconds": cpu_seconds() - cpu,
        "timings": timings,
    }
    right = np.einsum("ij,ij->i", normals, truth) > 0
    record["aligned"] = float(right[~interior].mean())
    if tile_points is None:
        np.savez(reference, normals=normals, strength=result.strength)
    elif reference.exists() and tile is not None:
        with np.load(reference) as one:
            same = np.einsum("ij,ij->i", one["normals"], normals) > 0
            visible = one["strength"] > VISIBLE
        at_border = border(points, tile)
        for name, chosen in (
            ("same", ~interior),
            ("same_all", np.ones_like(same)),
            ("same_visible", visible),
            ("same_border", visible & at_border),
            ("same_elsewhere", visible & ~at_border),
        ):
            record[name] = float(same[chosen].mean())
        record["border_points"] = int((visible & at_border).sum())
    record["load"] = os.getloadavg()[1]
    print(json.dumps(record))


def solve_in_tiles(
    points: NDArray[np.float64], tile_points: int, workers: int | None
) -> tuple[NDArray[np.float64], dict[str, float], NDArray[np.int64], dict[str, Any]]:
    """Solve in tiles as `estimate_normals` does, and tell as well which tile owns each point (n,)."""
    from face_plugin import Execution, Params
    from face_plugin.io.sources import ArraySource
    from face_plugin.tiles.run import collect, solve_store, tile_seconds

    engine = "serial" if workers == 1 else "processes"
    execution = Execution(tile_points=tile_points, workers=workers, engine=engine)
    with tempfile.TemporaryDirectory(prefix="face-") as name:
        folder = Path(name)
        store, timings = solve_store(folder, ArraySource(points), Params(), execution=execution)
        start = time.perf_counter()
        normals = collect(store)["normals"]
        timings = {**timings, "merge": time.perf_counter() - start, **tile_seconds(store)}
        tile = np.empty(len(points), dtype=np.int64)
        tile[store.rows()] = np.repeat(np.arange(store.tiles), np.diff(store.start))
        sizes = {
            "tiles": store.tiles,
            "coarse_points": len(np.load(folder / "voxels.npz")["points"]),
            "coarse_gb": (folder / "coarse.npz").stat().st_size / 1e9,
            "disk_gb": sum(file.stat().st_size for file in folder.iterdir()) / 1e9,
        }
    return normals, timings, tile, sizes


def border(points: NDArray[np.float64], tile: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Find the points (n,) with one of another tile within two spacings."""
    from scipy.spatial import cKDTree

    distance, near = cKDTree(points).query(points, k=NEIGHBOURS + 1, workers=-1)
    reach = BORDER * distance[:, 1:7].mean(axis=1, keepdims=True)
    return np.asarray(((tile[near] != tile[:, None]) & (distance < reach)).any(axis=1))


def cpu_seconds() -> float:
    """Processor time of this process and of those it waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


if __name__ == "__main__":
    main()
