"""On which side are the normals? Four kinds of scan, without a hint and with one; wrong sides are red.

    python examples/which_side.py [--points N] [--only NAME ...] [--out FOLDER]

The scans are generated (face_plugin.examples). Pictures: which_side_NAME.png, and which_side.png of room and street.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from panels import aligned, save_small
from scipy.spatial import cKDTree

import face_plugin
from face_plugin import examples
from face_plugin.app.plot import Camera, render_points
from face_plugin.shapes import sphere

RIGHT, WRONG, SENSOR = (0.45, 0.6, 0.8), (0.85, 0.2, 0.15), (1.0, 0.75, 0.0)
VIEWS = {
    "room": (-65.0, 50.0),
    "terrain": (-60.0, 35.0),
    "street": (-65.0, 40.0),
    "frame": (200.0, 25.0),
}
# What is farther out is not drawn: a room is looked into from above, and a street from near by.
SHOWN = {"room": ((-9.0, 0.4, -9.0), (9.0, 9.0, 2.3)), "street": ((-25.0, -16.0, -1.0), (25.0, 16.0, 12.0))}
BALL = sphere(60).points


def by_tangent_planes(points: Any) -> Any:
    """Open3D's own two calls."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals()
    cloud.orient_normals_consistent_tangent_plane(15)
    return np.asarray(cloud.normals)


def image(name: str, scan: Any, normals: Any) -> Any:
    """Points as discs, blue where they face free space; sensors are yellow."""
    lower, upper = SHOWN.get(name, (-np.inf, np.inf))
    shown = ((scan.points > lower) & (scan.points < upper)).all(axis=1)
    wrong = (normals * scan.normals).sum(axis=1) < 0
    radius = 0.75 * float(np.median(cKDTree(scan.points).query(scan.points, k=5)[0][:, 1:].mean(axis=1)))
    drawn, paint, across = [scan.points[shown]], [np.where(wrong[:, None], WRONG, RIGHT)[shown]], [normals[shown]]
    if scan.viewpoints is not None:
        size = 0.02 * float(np.ptp(scan.points[shown], axis=0).max())
        for place in scan.viewpoints:
            drawn.append(place + size * BALL)
            paint.append(np.tile(SENSOR, (len(BALL), 1)))
            across.append(BALL)
    points = np.concatenate(drawn)
    camera = Camera.around(points, view=VIEWS[name])
    return render_points(
        points, np.concatenate(paint), radius=radius, normals=np.concatenate(across), camera=camera, size=380
    )


def hint(scan: Any) -> dict[str, Any]:
    return {"up": scan.up} if scan.viewpoints is None else {"viewpoints": scan.viewpoints}


def save(path: Path, panels: list[tuple[str, Any]], columns: int) -> None:
    """Write titled images in rows to a PNG."""
    images = [cropped(picture) for _, picture in panels]
    rows = len(panels) // columns
    heights = [max(image.shape[0] for image in images[k * columns : (k + 1) * columns]) for k in range(rows)]
    size = images[0].shape[1]
    figure = Figure(figsize=(3.6 * columns, sum(0.45 + 3.6 * height / size for height in heights)))
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, squeeze=False, height_ratios=[0.45 + 3.6 * h / size for h in heights])
    for axes, image, (title, _) in zip(grid.ravel(), images, panels, strict=True):
        axes.imshow(image)
        axes.set_title(title, fontsize=9)
        axes.axis("off")
    figure.tight_layout()
    save_small(figure, path)


def cropped(image: Any) -> Any:
    """Leave out empty rows above and below."""
    rows = np.flatnonzero(image[..., 3].any(axis=1))
    return image[rows[0] : rows[-1] + 1]


def panels_of(name: str, points: int) -> list[tuple[str, Any]]:
    scan = examples.load(name, points)
    told = hint(scan)
    tried = [("Open3D, tangent planes", by_tangent_planes(scan.points))]
    tried.append(("FaCE, no hint", face_plugin.estimate_normals(scan.points).normals))
    tried.append((f"FaCE, {next(iter(told))}=", face_plugin.estimate_normals(scan.points, **told).normals))
    panels = []
    for title, normals in tried:
        share = aligned(normals, scan.normals)
        print(f"{name}: {title}: {share:.1f} % right")
        panels.append((f"{name}: {title}\n{share:.1f} % right", image(name, scan, normals)))
    return panels


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=examples.POINTS)
    parser.add_argument("--only", nargs="*", choices=list(VIEWS), default=list(VIEWS))
    parser.add_argument("--out", type=Path, default=Path("."))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    found = {}
    for name in args.only:
        found[name] = panels_of(name, args.points)
        save(args.out / f"which_side_{name}.png", found[name], 3)
    if {"room", "street"} <= set(found):
        chosen = [found[name][k] for name in ("room", "street") for k in (0, -1)]
        save(args.out / "which_side.png", chosen, 2)


if __name__ == "__main__":
    main()
