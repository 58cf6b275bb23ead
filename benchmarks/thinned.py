"""Sides of scans thinned to a grid, without a hint, beside Open3D's: generated streets and yards, as a Markdown table.

    python benchmarks/thinned.py [--seeds 6]

Streets are those of the sample data, from three places; yards those of stations.py, from one place all round. Of each
cell of a grid one point is kept: density then tells little or nothing of where the scanner stood. Either side counts as
right, as a whole. Open3D: planes of 30 neighbours, and consistent tangent planes of 15.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np
import open3d
import stations
import truth
from numpy.typing import NDArray

import face_plugin
from face_plugin.shapes.scans import Scan, scan_boxes
from face_plugin.shapes.scenes import street

# Metres.
CELLS = (0.4, 0.6, 0.9)


def scans(seeds: int) -> Iterator[tuple[str, Scan]]:
    """Yield streets and yards by name."""
    for seed in range(seeds):
        yield f"street {seed}", street(40_000, seed)
        rng = np.random.default_rng(seed)
        boxes, station = stations.yard(rng)
        yield f"yard {seed}", scan_boxes(boxes, station, stations.RAYS["all round"], 15_000, rng, noise=0.003)


def by_host(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give normals (n, 3) as Open3D orients them."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(30))
    cloud.orient_normals_consistent_tangent_plane(15)
    return np.asarray(cloud.normals)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=6)
    rows, every = [], []
    for name, scan in scans(parser.parse_args().seeds):
        for cell in CELLS:
            kept = np.unique(np.floor(scan.points / cell), axis=0, return_index=True)[1]
            points, true = scan.points[kept], scan.normals[kept]
            found = face_plugin.estimate_normals(points, filter_interior=True)
            assert found.interior is not None
            right = [stations.right(normals, true) for normals in (found.normals, by_host(points))]
            every.append([*(max(share, 100 - share) for share in right), 100 * float(found.interior.mean())])
            rows.append([name, f"{cell:g}", f"{len(points):,}", *(f"{share:.2f}" for share in every[-1])])
    rows.append(["mean", "", "", *(f"{share:.2f}" for share in np.mean(every, axis=0))])
    print(truth.table(["scan", "cell, m", "points", "right side, %", "Open3D, %", "dropped, %"], rows))


if __name__ == "__main__":
    main()
