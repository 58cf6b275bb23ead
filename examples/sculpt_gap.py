"""A body with a gap, through which the field leaks in, closed by cage points (the paper's figure 5).

    python examples/sculpt_gap.py [--points N] [--out FOLDER]

A kettle without a lid, and a box left in it. What the field reaches counts as outside, here by the paper's
threshold for complete input: part of the box is not recognised as interior, and draws the surface in. The
picture is sculpt_gap.png.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from sculpt_panels import BeforeAfter

from face_plugin import FaCE, Params
from face_plugin.shapes import from_solids
from face_plugin.shapes.solids import ball, block, ring

OPENING = 30.0  # half the angle of the lid, degrees


def kettle(count: int) -> tuple[Any, Any, Any]:
    """Give points, normals, and which of the points are interior."""
    handle = ring(0.75, 0.12).moved((0.0, 0.0, 0.85), Rotation.from_euler("x", 90, degrees=True))
    turn = Rotation.from_euler("xyz", [20, 35, 10], degrees=True)
    shape = from_solids([ball(1.0), handle, block((0.7, 0.5, 0.6)).moved((0.0, 0.0, 0.1), turn)], count)
    on_ball = np.abs(np.linalg.norm(shape.points, axis=1) - 1.0) < 1e-6
    kept = ~(on_ball & (shape.points[:, 2] > np.cos(np.radians(OPENING))))
    return shape.points[kept], shape.normals[kept], shape.interior[kept]


def lid(angles: list[float], counts: list[int]) -> Any:
    """Rings of places where the lid should be, at these angles from its middle (degrees)."""
    rings = []
    for angle, count in zip(np.radians(angles), counts, strict=True):
        turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        circle = [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.full(count, np.cos(angle))]
        rings.append(np.column_stack(circle))
    return np.concatenate(rings)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=5000)
    parser.add_argument("--out", type=Path, default=Path("out"))
    args = parser.parse_args()
    points, truth, interior = kettle(args.points)
    face = FaCE(points, Params(alpha="dense"))
    pictures = BeforeAfter(points, truth)

    def report(title: str) -> None:
        dropped = face.interior()
        found, lost = 100 * dropped[interior].mean(), 100 * dropped[~interior].mean()
        print(f"{title}: {found:.1f} % of the interior points found, {lost:.1f} % of the others lost")
        pictures.add(title, face, ~dropped)

    report("before")
    # Small ones where the lid should be. The default reach, nine tenths of the way to the rim, would make a
    # plug that stands out of the body, and the normals at the rim would turn away from it.
    edits = face.add_cage_points(lid([0.0, 10.0, 20.0], [1, 6, 12]), radius=0.1)
    print(f"{sum(len(edit.places) for edit in edits)} vertices of the mesh join the cage")
    report("gap closed")
    pictures.save(args.out / "sculpt_gap.png")


if __name__ == "__main__":
    main()
