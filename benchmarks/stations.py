"""Whether single views face their station without a hint: generated yards, in any position, as a Markdown table.

    python benchmarks/stations.py [--yards 24]

A ground of 40 m with up to eight boxes on it is scanned from one place by rays all round, by 32 rings, or by a camera,
4,000 to 14,000 points with noise of 3 mm, turned at random and moved to map coordinates.
"""

from __future__ import annotations

import argparse

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


def yard(rng: np.random.Generator) -> list[Box]:
    """Make a ground, and boxes that stand on it beside its middle."""
    boxes: list[Box] = [((-20.0, -20.0, -0.5), (20.0, 20.0, 0.0))]
    for _ in range(rng.integers(0, 9)):
        x, y = rng.uniform(-12, 12, 2)
        if max(abs(x), abs(y)) < 2.5:
            x, y = x + 4 * np.sign(x), y + 4 * np.sign(y)
        width, depth, height = rng.uniform(0.5, 3, 3)
        boxes.append(((x - width, y - depth, 0.0), (x + width, y + depth, 2 * height)))
    return boxes


def right(normals: NDArray[np.floating], true: NDArray[np.float64]) -> float:
    """Share of normals on the side of the station, in percent."""
    return 100 * float((np.einsum("nd,nd->n", normals, true) > 0).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--yards", type=int, default=24)
    args = parser.parse_args()
    rows = []
    for seed in range(args.yards):
        rng = np.random.default_rng(seed)
        boxes = yard(rng)
        station = np.array([*rng.uniform(-1, 1, 2), rng.uniform(1, 3)])
        name = list(RAYS)[seed % 3]
        made: Scan = scan_boxes(boxes, [station], RAYS[name], int(rng.integers(4000, 14000)), rng, noise=0.003)
        turn = Rotation.random(random_state=seed).as_matrix()
        points, true = made.points @ turn.T + SHIFT, made.normals @ turn.T
        blind = face_plugin.estimate_normals(points).normals
        told = face_plugin.estimate_normals(points, viewpoints=[turn @ station + SHIFT]).normals
        rows.append(
            [name, f"{len(boxes) - 1}", f"{len(points):,}", f"{right(blind, true):.2f}", f"{right(told, true):.2f}"]
        )
    print(truth.table(["rays", "boxes", "points", "without a hint, %", "with the viewpoint, %"], rows))


if __name__ == "__main__":
    main()
