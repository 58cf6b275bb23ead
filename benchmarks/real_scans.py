"""Sides, angles and points lost on the generated scans of `face_plugin.examples`, as a Markdown table.

    python benchmarks/real_scans.py [--points 8000 20000] [--seeds 0 1 2]

Right: share of the normals on the true side, in percent; blind, either side of an open scan as a whole counts. Angle:
mean of the lines' angles to the truth, in degrees; beside it that of Open3D's plane of 30 neighbours. Lost: share of
the points that the interior filter drops, in percent; all of them are surface, but for the box inside the object.
"""

import argparse

import numpy as np
import open3d as o3d

import face_plugin
from face_plugin import examples

OPEN = ("room", "terrain", "street", "frame")


def angle(lines: np.ndarray, truth: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(np.abs((lines * truth).sum(axis=1)), 0, 1))).mean())


def planes(points: np.ndarray) -> np.ndarray:
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
    return np.asarray(cloud.normals)


def rows(name: str, count: int, seed: int) -> list[str]:
    scan = examples.load(name, count, seed)
    hints: list[dict[str, object]] = [{}]
    if scan.viewpoints is not None and len(scan.viewpoints):
        hints.append({"viewpoints": scan.viewpoints})
    if scan.up is not None:
        hints.append({"up": scan.up})
    plain, out = angle(planes(scan.points), scan.normals), []
    for hint in hints:
        result = face_plugin.estimate_normals(scan.points, filter_interior=True, **hint)
        right = 100 * float(((result.normals * scan.normals).sum(axis=1) > 0).mean())
        if not hint and name in OPEN:
            right = max(right, 100 - right)
        lost = 100 * float((~result.kept).mean())
        told = next(iter(hint), "blind")
        mean = angle(result.normals, scan.normals)
        out.append(
            f"| {name} {len(scan.points):,} | {seed} | {told} | {right:.2f} | {mean:.2f} | {plain:.2f} | {lost:.2f} |"
        )
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, nargs="+", default=[8000])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    args = parser.parse_args()
    print("| scan | seed | told | right | angle | plane of 30 | lost |\n|---|---|---|---|---|---|---|")
    for name in examples.NAMES:
        for count in args.points:
            for seed in args.seeds:
                print(*rows(name, count, seed), sep="\n", flush=True)


if __name__ == "__main__":
    main()
