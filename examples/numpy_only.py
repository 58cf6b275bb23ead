"""Arrays in, arrays out: normals, the interior test, and a surface without any host's types.

    python examples/numpy_only.py [CLOUD] [--points N] [--out FOLDER]

CLOUD is a .npy file of shape (n, 3); without it a shape is generated. The picture is numpy_only.png.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from panels import cloud_image, mesh_image, save_panels

import face_plugin
from face_plugin.shapes import demo_shape


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cloud", nargs="?", type=Path)
    parser.add_argument("--points", type=int, default=6000)
    parser.add_argument("--out", type=Path, default=Path("."))
    args = parser.parse_args()
    points = np.load(args.cloud) if args.cloud else demo_shape(args.points).points

    surface = face_plugin.reconstruct(points, depth=7)
    result = surface.result

    print(f"{len(points):,} points, {int(result.interior.sum()):,} of them inside the object")
    print(f"{len(surface.faces):,} triangles")
    args.out.mkdir(parents=True, exist_ok=True)
    np.save(args.out / "numpy_only_normals.npy", result.normals)
    panels = [
        ("normals", cloud_image(points, result.normals)),
        ("surface", mesh_image(surface.vertices, surface.faces, points)),
    ]
    save_panels(args.out / "numpy_only.png", panels)


if __name__ == "__main__":
    main()
