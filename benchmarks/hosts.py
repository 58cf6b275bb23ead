"""FaCE through its hosts: what a drop-in costs, and how it compares with Open3D's own normals.

    python benchmarks/hosts.py overhead --points 20000
    python benchmarks/hosts.py compare --points 5000

`overhead` times what the adapters add to the array call. `compare` prints a table over generated shapes:
`estimate_normals()` + `orient_normals_consistent_tangent_plane(15)` against FaCE: the normals that point
outward, and the distance between the truth and the screened Poisson surface from them. Both print Markdown.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import open3d as o3d
import pymeshlab
from scipy.spatial import cKDTree

import face_plugin
from face_plugin import FaCE, Params, shapes
from face_plugin.adapters import open3d as face
from face_plugin.adapters import pymeshlab as faraday
from face_plugin.filters import pointset
from face_plugin.surface import poisson_reconstruction

Cloud = Callable[[int], shapes.Shape]


def coplanar(n: int) -> shapes.Shape:
    """Points of one plane; which side is outward is a matter of choice, but of one."""
    points = np.column_stack([np.random.default_rng(0).random((n, 2)), np.zeros(n)])
    return shapes.Shape(points, np.tile([0.0, 0.0, 1.0], (n, 1)), np.zeros(n, dtype=bool), np.zeros(n))


SHAPES: dict[str, Cloud] = {
    "two disjoint spheres": shapes.disjoint_spheres,
    "slab, thickness 0.01": lambda n: shapes.slab(n, thickness=0.01),
    "the same, ball at every point, field normals": lambda n: shapes.slab(n, thickness=0.01),
    "coplanar points": coplanar,
    "sphere": shapes.sphere,
    "torus": shapes.torus,
    "box": shapes.box,
    "slab, thickness 0.05": shapes.slab,
    "mug, 3 diameters deep": shapes.cup,
    "bowl": shapes.bowl,
    "spherical shell": shapes.spherical_shell,
    "crossed cylinders": shapes.crossed_cylinders,
    "two crossing spheres": shapes.two_spheres,
    "box in a sphere": shapes.nested_box,
    "teapot, parts cross": shapes.teapot,
    "teapot, box inside": shapes.demo_shape,
    "two scans, 3 degrees off": shapes.doubled_shell,
}

# By default the cage leaves out points that are close, and planes are fitted to the nearest points: on a plate
# thinner than the spacing both mix its two sides.
PARAMS: dict[str, dict[str, Any]] = {
    "the same, ball at every point, field normals": {"cage_spacing": 0.0, "angles": "field"}
}


class TimedFaCE(FaCE):
    """The method, keeping account of the seconds that it takes itself."""

    seconds = 0.0

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        with TimedFaCE.counted():
            super().__init__(*args, **kwargs)

    def result(self, **kwargs: Any) -> Any:
        """Return what `FaCE.result` does."""
        with TimedFaCE.counted():
            return super().result(**kwargs)

    @staticmethod
    @contextmanager
    def counted() -> Iterator[None]:
        """Add the seconds of a block to the account."""
        start = time.perf_counter()
        yield
        TimedFaCE.seconds += time.perf_counter() - start


def overhead(n: int, repeats: int) -> None:
    points = shapes.demo_shape(n).points
    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    tensor = o3d.t.geometry.PointCloud(points)
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(points))

    def under_install() -> None:
        with face.installed():
            legacy.estimate_normals()
            legacy.orient_normals_consistent_tangent_plane(15)

    calls: dict[str, Callable[[], Any]] = {
        "`open3d.estimate_normals(pcd)`, legacy": lambda: face.estimate_normals(legacy),
        "`open3d.estimate_normals(pcd)`, tensor": lambda: face.estimate_normals(tensor),
        "Open3D's own lines under `installed()`": under_install,
        "`compute_normal_by_faraday_cage(ms)`": lambda: faraday.compute_normal_by_faraday_cage(ms),
    }
    # The array call is the method; runs differ by more than an adapter takes, so it is timed within each.
    pointset.FaCE = TimedFaCE
    runs: dict[str, list[tuple[float, float]]] = {name: [] for name in calls}
    for _ in range(repeats + 1):
        for name, call in calls.items():
            TimedFaCE.seconds = 0.0
            start = time.perf_counter()
            call()
            runs[name].append((time.perf_counter() - start, TimedFaCE.seconds))
    print(f"\n| call, {n:,} points, best of {repeats} | method, s | adapter, s | over the array call |")
    print("|---|---|---|---|")
    for name, taken in runs.items():
        method = min(inner for _, inner in taken[1:])
        adapter = min(whole - inner for whole, inner in taken[1:])
        print(f"| {name} | {method:.2f} | {adapter:.4f} | {100 * adapter / method:.2f} % |")


def host_normals(points: Any) -> Any:
    """Get normals as a script without FaCE does, or Open3D's words where it gives none."""
    pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    pcd.estimate_normals()
    try:
        pcd.orient_normals_consistent_tangent_plane(15)
    except RuntimeError as error:
        return str(error).split()[0]
    return np.asarray(pcd.normals)


def aligned(normals: Any, truth: Any, either: bool) -> float:
    """Percentage on the right side; of a plane, on the side of the majority."""
    right = float(((normals * truth).sum(axis=1) > 0).mean())
    return 100 * (max(right, 1 - right) if either else right)


def distance(points: Any, normals: Any, truth: shapes.Shape) -> float:
    """Mean distance between surface and true points, both ways, in thousandths of the diagonal."""
    vertices, faces, _ = poisson_reconstruction(points, normals, depth=7, backend="open3d")
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces.astype(np.int32))
    )
    o3d.utility.random.seed(0)
    outer = truth.points[~truth.interior]
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    there = scene.compute_distance(outer.astype(np.float32)).numpy()
    sample = np.asarray(mesh.sample_points_uniformly(len(outer)).points)
    tree = cKDTree(outer)
    back, nearest = tree.query(sample)
    # Between true points the distance to their tangent planes counts, not to them; far off, to them.
    height = np.abs(((sample - outer[nearest]) * truth.normals[~truth.interior][nearest]).sum(axis=1))
    spacing = 1.5 * float(np.median(tree.query(outer, k=2)[0][:, 1]))
    back = np.maximum(height, back - spacing)
    return 500 * float(there.mean() + back.mean()) / float(np.linalg.norm(np.ptp(outer, axis=0)))


def compare(n: int) -> None:
    face_plugin.estimate_normals(shapes.sphere(200).points, filter_interior=True)  # compile
    head = [f"{host}: {what}" for what in ("outward", "surface, ‰", "s") for host in ("Open3D", "FaCE")]
    print(f"\n| {n:,} points | {' | '.join(head)} |\n|{'---|' * (len(head) + 1)}")
    for name, make in SHAPES.items():
        shape, truth = make(n), make(4 * n)
        start = time.perf_counter()
        host = host_normals(shape.points)
        host_seconds = time.perf_counter() - start
        start = time.perf_counter()
        params = Params(**PARAMS.get(name, {}))
        result = face_plugin.estimate_normals(shape.points, params, filter_interior=True)
        seconds = time.perf_counter() - start
        plane = name == "coplanar points"
        cells = [name]
        if isinstance(host, str):
            cells += [host, f"{aligned(result.normals, shape.normals, plane):.1f} %"]
        else:
            cells += [f"{aligned(v, shape.normals, plane):.1f} %" for v in (host, result.normals)]
        keep = ~result.interior
        # A plane has no inside: there is no surface to compare with.
        cells.append("-" if plane else f"{distance(shape.points, host, truth):.2f}")
        cells.append("-" if plane else f"{distance(shape.points[keep], result.normals[keep], truth):.2f}")
        print(f"| {' | '.join(cells)} | {host_seconds:.1f} | {seconds:.1f} |", flush=True)


def main() -> None:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("what", choices=("overhead", "compare"))
    parser.add_argument("--points", type=int, help="[default: 20000 for overhead, 5000 for compare]")
    parser.add_argument("--repeats", type=int, default=5)
    args = parser.parse_args()
    if args.what == "overhead":
        overhead(args.points or 20_000, args.repeats)
    else:
        compare(args.points or 5_000)


if __name__ == "__main__":
    main()
