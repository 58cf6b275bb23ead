"""A MeshLab filter script with FaCE among MeshLab's own filters.

    python examples/meshlab_script.py [SCRIPT] [--points N] [--out FOLDER]

SCRIPT is faraday.mlx beside this file: it drops duplicates, selects the points inside the object and deletes
them, gives the others normals, and reconstructs. The picture meshlab_script.png shows points and result.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pymeshlab
from panels import cloud_image, mesh_image, save_panels

from face_plugin.adapters.pymeshlab import run_filter_script
from face_plugin.shapes import demo_shape


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("script", nargs="?", type=Path, default=Path(__file__).with_name("faraday.mlx"))
    parser.add_argument("--points", type=int, default=6000)
    parser.add_argument("--out", type=Path, default=Path("."))
    args = parser.parse_args()
    shape = demo_shape(args.points)
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(shape.points), "scan")
    run_filter_script(ms, args.script)
    scan, mesh = ms.mesh(0), ms.current_mesh()
    print(f"{scan.label()}: {scan.vertex_number():,} of {len(shape):,} points are left")
    print(f"{mesh.label()}: {mesh.face_number():,} triangles")
    args.out.mkdir(parents=True, exist_ok=True)
    ms.save_current_mesh(str(args.out / "meshlab_script.ply"))
    points = cloud_image(scan.vertex_matrix(), scan.vertex_normal_matrix())
    surface = mesh_image(mesh.vertex_matrix(), mesh.face_matrix(), shape.points)
    save_panels(args.out / "meshlab_script.png", [("points kept, normals", points), (mesh.label(), surface)])


if __name__ == "__main__":
    main()
