"""An Open3D script that knows nothing of FaCE, run as it is and under `installed()`.

    python examples/open3d_dropin.py [--points N] [--out FOLDER]

The picture open3d_dropin.png shows the surface that the same lines make in both runs, of two spheres that do
not touch: Open3D's minimum spanning tree orients one of them inward.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import open3d as o3d
from panels import aligned, mesh_image, save_panels

from face_plugin.adapters.open3d import installed
from face_plugin.shapes import disjoint_spheres


def tutorial(pcd: o3d.geometry.PointCloud) -> o3d.geometry.TriangleMesh:
    """Surface reconstruction as Open3D's tutorials do it, unchanged."""
    print("Estimate and orient normals")
    pcd.normals = o3d.utility.Vector3dVector(np.zeros((1, 3)))  # invalidate existing normals
    pcd.estimate_normals(search_param=o3d.geometry.KDTreeSearchParamHybrid(radius=0.3, max_nn=30))
    pcd.orient_normals_consistent_tangent_plane(15)
    print("Run Poisson surface reconstruction")
    mesh, densities = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(pcd, depth=7, n_threads=1)
    print(f"{len(mesh.triangles):,} triangles, densities from {min(densities):.1f} to {max(densities):.1f}")
    return mesh


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=3000)
    parser.add_argument("--out", type=Path, default=Path("."))
    args = parser.parse_args()
    shape = disjoint_spheres(args.points)
    panels = []
    for name in ("Open3D", "installed()"):
        pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(shape.points))
        if name == "Open3D":
            mesh = tutorial(pcd)
        else:
            with installed():
                mesh = tutorial(pcd)
        title = f"{name}: {aligned(pcd.normals, shape.normals):.1f} % of normals outward"
        print(title)
        image = mesh_image(np.asarray(mesh.vertices), np.asarray(mesh.triangles), shape.points)
        panels.append((title, image))
    args.out.mkdir(parents=True, exist_ok=True)
    save_panels(args.out / "open3d_dropin.png", panels)


if __name__ == "__main__":
    main()
