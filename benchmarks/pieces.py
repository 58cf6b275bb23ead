"""Sides of what scripts leave of a scan, without a hint, beside Open3D's: generated clouds, as a Markdown table.

    python benchmarks/pieces.py [--seeds 2] [--each]

What scripts do before they ask for normals: keep a quarter at random, crop a box, take out the largest plane, take the
largest cluster of what that leaves, look at what is seen from one side, and put two scans together that are registered
to 0.4 degrees. Scenes are those of the sample data, bodies some of the generated ones. Either side counts as right, as
a whole, but of whole bodies. Open3D: planes of 30 neighbours, and consistent tangent planes of 15.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np
import open3d
import stations
import thinned
import truth
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import face_plugin
from face_plugin import shapes
from face_plugin.shapes import scenes

Points = NDArray[np.float64]
BODIES = (shapes.teapot, shapes.torus, shapes.cup, shapes.shelves, shapes.box, shapes.crossed_cylinders)
SCENES = (scenes.room, scenes.street, scenes.terrain, scenes.depth_frame)
MOST, FEWEST = 12_000, 800


def clouds(seeds: int) -> Iterator[tuple[str, Points, Points, bool]]:
    """Yield name, points, normals, and whether it is a whole body."""
    for seed in range(seeds):
        for make in SCENES:
            scan = make(16_000, seed)
            yield make.__name__, scan.points, scan.normals, False
        for body in BODIES:
            shape = body(8_000, seed)
            seen = ~shape.interior
            yield body.__name__, shape.points[seen], shape.normals[seen], True


def pieces(points: Points, body: bool, rng: np.random.Generator) -> Iterator[tuple[str, NDArray[np.intp], bool]]:
    """Yield what was done, the rows that it leaves, and whether these are a whole body still."""
    n, extent = len(points), np.ptp(points, axis=0)
    yield "a quarter at random", rng.permutation(n)[: n // 4], body
    for _ in range(2):
        reach = extent * rng.uniform(0.2, 0.35)
        yield "a box", np.flatnonzero((np.abs(points - points[rng.integers(n)]) < reach).all(axis=1)), False
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    rest = np.setdiff1d(np.arange(n), cloud.segment_plane(0.01 * float(np.linalg.norm(extent)), 3, 500)[1])
    yield "without the largest plane", rest, False
    left = cloud.select_by_index(rest)
    cluster = np.asarray(left.cluster_dbscan(0.02 * float(np.linalg.norm(extent)), 8))
    if cluster.max(initial=-1) >= 0:
        yield "largest cluster of that", rest[cluster == np.argmax(np.bincount(cluster[cluster >= 0]))], False
    if body:
        away = 2 * np.linalg.norm(extent) * Rotation.random(random_state=rng).as_matrix()[0]
        yield "from one side", np.sort(cloud.hidden_point_removal(away, 100 * np.linalg.norm(extent))[1]), False


def registered(points: Points, normals: Points, rng: np.random.Generator) -> tuple[Points, Points]:
    """Turn half of the points by 0.4 degrees, and move them by 0.3 % of the extent."""
    half = rng.permutation(len(points)) % 2 == 0
    turn = Rotation.from_rotvec(np.radians(0.4) * Rotation.random(random_state=rng).as_matrix()[0])
    shift = 0.003 * np.linalg.norm(np.ptp(points, axis=0)) * Rotation.random(random_state=rng).as_matrix()[0]
    moved = turn.apply(points) + shift
    return np.where(half[:, None], moved, points), np.where(half[:, None], turn.apply(normals), normals)


def judged(points: Points, normals: Points, body: bool) -> list[float]:
    """Right sides in %, ours and Open3D's, and what is dropped of it, in %."""
    found = face_plugin.estimate_normals(points, filter_interior=True)
    assert found.interior is not None
    ours, host = (stations.right(lines, normals) for lines in (found.normals, thinned.by_host(points)))
    return [ours if body else max(ours, 100 - ours), max(host, 100 - host), 100 * float(found.interior.mean())]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--each", action="store_true", help="a line a cloud")
    args = parser.parse_args()
    open3d.utility.random.seed(0)
    found: dict[str, list[list[float]]] = {}
    for number, (name, points, normals, body) in enumerate(clouds(args.seeds)):
        rng = np.random.default_rng(number)
        left = [(done, points[rows], normals[rows], whole) for done, rows, whole in pieces(points, body, rng)]
        left.append(("two, registered", *registered(points, normals, rng), body))
        for done, some, true, whole in left:
            if len(some) < FEWEST:
                continue
            kept = np.sort(rng.permutation(len(some))[:MOST])
            values = judged(some[kept], true[kept], whole)
            found.setdefault(done, []).append(values)
            if args.each:
                print(f"{name}, {done}: {len(kept)} points", *(f"{value:.2f}" for value in values), flush=True)
    rows = []
    for done, every in (*found.items(), ("all", [values for some in found.values() for values in some])):
        ours, host, dropped = np.array(every).T
        counts = [int((ours < host - 0.3).sum()), int((ours > host + 0.3).sum())]
        rows.append([done, str(len(every)), *(f"{v.mean():.2f}" for v in (ours, host, dropped)), *map(str, counts)])
    titles = ["what is left", "clouds", "right side, %", "Open3D, %", "dropped, %", "0.3 below Open3D", "0.3 above"]
    print(truth.table(titles, rows))


if __name__ == "__main__":
    main()
