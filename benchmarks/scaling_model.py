"""Time and memory of clouds and clusters that were not measured, from what `scaling.py` measured.

    python benchmarks/scaling_model.py out/scaling.json --points 100000000 --workers 100

The assumptions, all of which the output repeats:

1. A tile costs what one did in the largest run measured: its time does not depend on the size of the cloud.
2. A worker has a core for itself, as fast as those here, and reads the shared folder at no cost. Processor time stands
   for time.
3. The last tiles leave workers idle: both stages end with the workers that have most tiles, each of which costs a fifth
   more than the mean. (Not with two workers.)
4. Before, between and after, one process reads the cloud three times, brings the coarse cage's points together and
   merges the tiles: in proportion to the points. The line through the two largest runs gives it; its constant part is
   the coarse cage.
5. The coarse cage has `prepare.COARSE_SHARE`, `COARSE_POINTS` and `MOST_A_COARSE` points, and costs no more time and
   memory than a cloud of as many points in one piece, as fitted to those measured.
6. A worker holds the coarse cage beside its tile: three times the size of its file, with the search structures.
7. The cloud comes from a file and is never held; what is written on disk is in proportion to the points.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scaling_report import groups

from face_plugin.tiles.prepare import COARSE_POINTS, COARSE_SHARE, MOST_A_COARSE

IMBALANCE = 1.2
LOADED = 3.0

Record = dict[str, Any]


@dataclass(frozen=True)
class Prediction:
    """What a run takes."""

    tiles: int
    coarse_points: int
    serial_seconds: float
    coarse_seconds: float
    tile_seconds: float
    worker_gb: float
    scheduler_gb: float
    disk_gb: float

    @property
    def seconds(self) -> float:
        """Seconds from end to end."""
        return self.serial_seconds + self.coarse_seconds + self.tile_seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("figures", type=Path, help="scaling.json of scaling.py")
    parser.add_argument("--points", type=int, default=100_000_000)
    parser.add_argument("--workers", type=int, default=100)
    args = parser.parse_args()
    records = [r for r in json.loads(args.figures.read_text()) if r["shape"] == "interiors"]
    tiled = [r for r in records if r["tile_points"] is not None and r["workers"] != 1]
    tiled.sort(key=lambda r: r["points"])
    one = groups(records).get(("interiors", False, None), [])
    largest = tiled[-1]
    if len(tiled) > 3:
        check = predict(one, tiled[:-1], largest["points"], largest["workers"])
        print(
            f"check: {largest['points']:,} points, from the smaller runs: {check.seconds:.0f} s with "
            f"{largest['workers']} workers, measured {largest['cpu_seconds'] / largest['workers']:.0f} s of processor "
            f"time for each and {largest['seconds']:.0f} s on the clock; {check.worker_gb:.2f} GB a worker, measured "
            f"{largest['worker_gb']:.2f}"
        )
    found = predict(one, tiled, args.points, args.workers)
    print(
        f"{args.points:,} points on {args.workers} workers: {found.seconds / 60:.1f} minutes\n"
        f"  reading, merging   {found.serial_seconds:8.0f} s\n"
        f"  coarse cage        {found.coarse_seconds:8.0f} s, {found.coarse_points:,} points\n"
        f"  tiles              {found.tile_seconds:8.0f} s, {found.tiles:,} of {largest['tile_points']:,} points\n"
        f"  memory             {found.worker_gb:8.2f} GB a worker, {found.scheduler_gb:.2f} GB the one that hands out\n"
        f"  disk               {found.disk_gb:8.0f} GB"
    )
    print(__doc__[__doc__.index("The assumptions") :])


def coarse_points(points: int) -> int:
    """Points aimed at for the coarse cage, as `face_plugin.tiles.prepare` does where memory is enough."""
    return max(int(np.clip(points // COARSE_SHARE, *COARSE_POINTS)), points // MOST_A_COARSE)


def predict(one: list[Record], tiled: list[Record], points: int, workers: int) -> Prediction:
    """Predict a run from those measured, each list in the order of its sizes."""
    base, before = tiled[-1], tiled[-2]
    tile_points = base["points"] / base["tiles"]
    serial = (base["own_cpu_seconds"] - before["own_cpu_seconds"]) / (base["points"] - before["points"])
    constant = max(base["own_cpu_seconds"] - serial * base["points"], 0.0)
    coarse, coarse_before = coarse_points(points), coarse_points(base["points"])
    size = np.log([r["points"] for r in one])
    power, factor = np.polyfit(size, np.log([r["cpu_seconds"] for r in one]), 1)
    slope = one[-1]["peak_gb"] / one[-1]["points"]
    tiles = -(-points // base["tile_points"])
    a_tile = sum(v for name, v in base["timings"].items() if name.startswith("tiles: ")) / base["tiles"]
    # Tiles of a small run are of another size than they are meant to be.
    a_tile *= points / tiles / tile_points
    uneven = IMBALANCE if workers > 2 else 1.0
    more = coarse / coarse_before - 1.0
    return Prediction(
        tiles=tiles,
        coarse_points=coarse,
        serial_seconds=serial * points,
        coarse_seconds=constant if coarse == coarse_before else float(np.exp(factor) * coarse**power),
        tile_seconds=uneven * math.ceil(tiles / workers) * a_tile,
        worker_gb=base["worker_gb"] + LOADED * more * base["coarse_gb"],
        scheduler_gb=max(base["parent_gb"], slope * coarse),
        disk_gb=base["disk_gb"] / base["points"] * points,
    )


if __name__ == "__main__":
    main()
