"""Whether scans face their stations without a hint: generated yards and rooms, in any position, as Markdown tables.

    python benchmarks/stations.py [--yards 24] [--rooms 12]

A yard is a ground of 40 m with up to eight boxes on it, scanned from one place by rays all round, by 32 rings, or by a
camera, 4,000 to 14,000 points. A room of 4 to 8 m has boxes in it and is scanned from one to four places by rays all
round, 10,000 to 20,000 points; what stands in it must not be dropped. Noise is 3 mm; all are turned at random and moved
to map coordinates.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
import truth
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import face_plugin
from face_plugin.shapes.scans import Box, Scan, camera_rays, ring_rays, scan_boxes, sphere_rays

RAYS = {
    "all round": sphere_rays(40_000),
    "rings": ring_rays(32, 1500),
    "camera": camera_rays(160, 120, [1.0, 0.2, -0.35]),
}
SHIFT = np.array([4e5, 5e6, 100.0])
# Stations keep so far from what stands beside them.
CLEAR = 0.25


def beside(boxes: list[Box], draw: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
    """Draw places (3,) until one is outside of all boxes."""
    while True:
        place = draw()
        if all(((place < np.subtract(low, CLEAR)) | (place > np.add(high, CLEAR))).any() for low, high in boxes):
            return place


def yard(rng: np.random.Generator) -> tuple[list[Box], NDArray[np.float64]]:
    """Make a ground, boxes that stand on it, and a place for a scanner in the middle."""
    boxes: list[Box] = [((-20.0, -20.0, -0.5), (20.0, 20.0, 0.0))]
    for _ in range(rng.integers(0, 9)):
        x, y = rng.uniform(-12, 12, 2)
        if max(abs(x), abs(y)) < 2.5:
            x, y = x + 4 * np.sign(x), y + 4 * np.sign(y)
        width, depth, height = rng.uniform(0.5, 3, 3)
        boxes.append(((x - width, y - depth, 0.0), (x + width, y + depth, 2 * height)))
    return boxes, beside(boxes, lambda: rng.uniform([-2.0, -2.0, 1.0], [2.0, 2.0, 3.0]))[None]


def room(rng: np.random.Generator, views: int) -> tuple[list[Box], NDArray[np.float64]]:
    """Make walls, boxes on the floor between them, and places for a scanner beside these."""
    size = rng.uniform([4.0, 3.0, 2.4], [8.0, 6.0, 3.0])
    boxes: list[Box] = [((0.0, 0.0, 0.0), tuple(size))]
    for _ in range(rng.integers(3, 8)):
        lower = np.append(rng.uniform(0.2, size[:2] - 1.0), 0.0)
        boxes.append((tuple(lower), tuple(lower + rng.uniform([0.3, 0.3, 0.4], [0.8, 0.8, 1.9]))))
    within = [0.4, 0.4, 1.2], [*(size[:2] - 0.4), 1.7]
    return boxes, np.array([beside(boxes[1:], lambda: rng.uniform(*within)) for _ in range(views)])


def right(normals: NDArray[np.floating], true: NDArray[np.float64]) -> float:
    """Share of normals on the side of the station, in percent."""
    return 100 * float((np.einsum("nd,nd->n", normals, true) > 0).mean())


def figures(made: Scan, stations: NDArray[np.float64], seed: int) -> list[str]:
    """Points, and what is right of them without a hint and with the viewpoints, and dropped without one."""
    turn = Rotation.random(random_state=seed).as_matrix()
    points, true = made.points @ turn.T + SHIFT, made.normals @ turn.T
    blind = face_plugin.estimate_normals(points, filter_interior=True)
    told = face_plugin.estimate_normals(points, viewpoints=stations @ turn.T + SHIFT)
    assert blind.interior is not None
    shares = right(blind.normals, true), right(told.normals, true), 100 * float(blind.interior.mean())
    return [f"{len(points):,}", *(f"{share:.2f}" for share in shares)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--yards", type=int, default=24)
    parser.add_argument("--rooms", type=int, default=12)
    args = parser.parse_args()
    head = ["points", "without a hint, %", "with the viewpoints, %", "dropped without a hint, %"]
    rows = []
    for seed in range(args.yards):
        rng = np.random.default_rng(seed)
        boxes, station = yard(rng)
        name = list(RAYS)[seed % 3]
        made = scan_boxes(boxes, station, RAYS[name], int(rng.integers(4000, 14000)), rng, noise=0.003)
        rows.append([name, f"{len(boxes) - 1}", *figures(made, station, seed)])
    print(truth.table(["rays", "boxes", *head], rows), end="\n\n")
    rows = []
    for seed in range(args.rooms):
        rng = np.random.default_rng(1000 + seed)
        boxes, stations = room(rng, seed % 4 + 1)
        made = scan_boxes(boxes, stations, sphere_rays(30_000), int(rng.integers(10_000, 20_000)), rng, noise=0.003)
        rows.append([f"{len(stations)}", f"{len(boxes) - 1}", *figures(made, stations, seed)])
    print(truth.table(["stations", "boxes", *head], rows))


if __name__ == "__main__":
    main()
