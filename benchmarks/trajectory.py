"""A long street scanned on the move: what a trajectory of poses costs in tiles, and what it tells.

    python benchmarks/trajectory.py [--points 1000000] [--piece 100000]

A car with 16 rings drives between houses, a pose every half metre, and keeps 500 points of each; noise is 1 cm. The
whole is solved in tiles without and with all poses, and the last of the street in one piece. Prints Markdown.
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np
import truth
from numpy.typing import NDArray

import face_plugin
from face_plugin.shapes.scans import Box, Scan, ring_rays, scan_boxes

# Metres: between poses, from the sensor to the farthest house that it sees, and along a house with the gap behind it.
STEP, REACH, HOUSE = 0.5, 40.0, 15.0
EACH = 500
# Poses that are scanned at once.
BLOCK = 20


def drive(poses: int, rng: np.random.Generator) -> Scan:
    """Scan a street from poses along x."""
    long = poses * STEP
    houses: list[Box] = []
    for side in (-1.0, 1.0):
        for start in np.arange(-REACH, long + REACH, HOUSE):
            front = side * rng.uniform(7.0, 9.0)
            back, height = front + side * 10.0, rng.uniform(6.0, 11.0)
            houses.append(((start, min(front, back), 0.0), (start + HOUSE - 2.0, max(front, back), height)))
            if rng.random() < 0.5:
                # A parked car.
                houses.append(((start, side * 4.5 - 0.9, 0.0), (start + 4.4, side * 4.5 + 0.9, 1.5)))
    rays, parts = ring_rays(16, 180), []
    for first in range(0, poses, BLOCK):
        x = STEP * np.arange(first, min(first + BLOCK, poses))
        views = np.column_stack([x, 0.3 * np.sin(x / 9.0), np.full(len(x), 1.9)])
        near = [box for box in houses if box[1][0] > x[0] - REACH and box[0][0] < x[-1] + REACH]
        ground: Box = ((x[0] - 2 * REACH, -30.0, -1.0), (x[-1] + 2 * REACH, 30.0, 0.0))
        parts.append(scan_boxes([ground, *near], views, rays, EACH * len(x), rng, noise=0.01, reach=REACH))
    points, normals, views = (
        np.concatenate([getattr(part, of) for part in parts]) for of in ("points", "normals", "viewpoints")
    )
    return Scan(points, normals, views)


def timed(points: NDArray[np.float64], **hint: object) -> tuple[NDArray[np.float64], float, float]:
    """Give normals (n, 3), seconds on the clock, and of processors."""

    def spent() -> float:
        used = [resource.getrusage(of) for of in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(of.ru_utime + of.ru_stime for of in used)

    clock, before = time.perf_counter(), spent()
    normals = face_plugin.estimate_normals(points, **hint).normals
    return normals, time.perf_counter() - clock, spent() - before


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--piece", type=int, default=100_000)
    args = parser.parse_args()
    scan = drive(args.points // EACH, np.random.default_rng(0))
    # Points at the cut have half of their neighbours there.
    piece = slice(len(scan) - args.piece, None)
    inside = scan.points[piece, 0] > scan.points[piece, 0].min() + 2 * REACH
    rows, found = [], {}
    for name, points, hint in (
        ("tiles, no hint", scan.points, {}),
        ("tiles, all poses", scan.points, {"viewpoints": scan.viewpoints}),
        ("one piece, its poses", scan.points[piece], {"viewpoints": scan.viewpoints[-args.piece // EACH :]}),
    ):
        normals, clock, spent = timed(points, **hint)
        right = np.einsum("nd,nd->n", normals, scan.normals[-len(points) :]) > 0
        share = 100 * float(right.mean())
        found[name] = normals[-args.piece :]
        rows.append([name, f"{len(points):,}", f"{spent:.0f}", f"{clock:.0f}", f"{share:.2f}"])
    print(truth.table(["run", "points", "processor, s", "clock, s", "right side, %"], rows))
    same = np.einsum("nd,nd->n", found["tiles, all poses"], found["one piece, its poses"])[inside] > 0
    print(f"\nTiles as one piece: {100 * same.mean():.2f} % of {len(same):,} points.")


if __name__ == "__main__":
    main()
