"""Scan in, mesh out, with Open3D: one line makes the difference.

    python examples/open3d_pipeline.py [SCAN] [--points N] [--out FOLDER]

Without SCAN (any cloud that Open3D reads) a shape is generated: a teapot whose parts cross, with a box left
inside. The picture open3d_pipeline.png shows both reconstructions; faces seen from behind are red.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import open3d as o3d
from panels import mesh_image, save_panels

from face_plugin.adapters import open3d as face
from face_plugin.shapes import demo_shape


def before(pcd: o3d.geometry.PointCloud) -> o3d.geometry.TriangleMesh:
    """Reconstruct as a script without FaCE does."""
    pcd.estimate_normals()
    pcd.orient_normals_consistent_tangent_plane(15)
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(pcd, depth=7, n_threads=1)
    return mesh


def after(pcd: o3d.geometry.PointCloud) -> o3d.geometry.TriangleMesh:
    """Do the same in one line: normals, interior points left out, and the surface."""
    mesh, _ = face.create_from_point_cloud_face(pcd, depth=7)
    return mesh


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scan", nargs="?", help="point cloud that Open3D reads")
    parser.add_argument("--points", type=int, default=6000, help="of the generated shape")
    parser.add_argument("--out", type=Path, default=Path("."))
    args = parser.parse_args()
    if args.scan:
        pcd = o3d.io.read_point_cloud(args.scan)
    else:
        pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(demo_shape(args.points).points))
    points = np.asarray(pcd.points).copy()
    panels = []
    for title, reconstruct in (("estimate_normals + MST + Poisson", before), ("FaCE", after)):
        mesh = reconstruct(o3d.geometry.PointCloud(pcd))
        print(f"{title}: {len(mesh.triangles):,} triangles, watertight: {mesh.is_watertight()}")
        panels.append((title, mesh_image(np.asarray(mesh.vertices), np.asarray(mesh.triangles), points)))
    args.out.mkdir(parents=True, exist_ok=True)
    o3d.io.write_triangle_mesh(str(args.out / "open3d_pipeline.ply"), mesh)
    save_panels(args.out / "open3d_pipeline.png", panels)


if __name__ == "__main__":
    main()
