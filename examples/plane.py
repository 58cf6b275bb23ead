"""A closed curve in the plane: the fields around its cage, E_max, and the normals (figure 2 of the paper).

    python examples/plane.py [--points N] [--out FOLDER]

The picture is plane.png. Discs on the curve conduct. An outer field along x, or along y, does not get inside; outside
it is weak where the curve runs along it, so the greatest strength over all its directions is taken. That grows outward.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from PIL import Image

from face_plugin import FaCE, Params
from face_plugin.faraday.field import vertex_gradients
from face_plugin.shapes.curves import star

TOP = 3.0
"""Greatest strength that is told apart."""
MARGIN = 0.5
"""Space that is drawn around the star."""
LINES = 32
"""Lines of equal potential."""
ARROW = 0.16
"""Length of a normal; the star has radius 1."""


def draw_field(axes: Any, face: FaCE, strength: Any, lines: Any | None) -> Any:
    """Paint a strength (m,) given at the vertices, with lines of equal potential (m,), and the discs."""
    corners = face.frame.from_unit(face.mesh.vertices)
    mesh = Triangulation(*corners.T, face.mesh.tets)
    painted = axes.tripcolor(mesh, np.minimum(strength, TOP), shading="gouraud", cmap="magma", vmin=0.0, vmax=TOP)
    if lines is not None:
        axes.tricontour(mesh, lines, levels=LINES, colors="white", linewidths=0.5)
    discs = [face.frame.from_unit(disc) for disc in face.balls.vertices]
    axes.add_collection(PolyCollection(discs, facecolors="#7fe0c4"))
    return painted


def main() -> None:
    """Solve the cage of a star, and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=120, metavar="N", help="points of the curve [default: 120]")
    parser.add_argument("--out", type=Path, default=Path(), metavar="FOLDER", help="where to [default: here]")
    args = parser.parse_args()
    points = star(args.points).points
    # Finer triangles than the normals need, and more space around: for the eye.
    face = FaCE(points, Params(grading=0.25, finest=0.5, padding=0.4))
    potential = face.potential()
    gradients = vertex_gradients(face.mesh, potential)
    # The canonical axes are turned: the fields along those of the input are combinations of the two.
    turn = face.frame.rotation
    figure = Figure(figsize=(15.0, 4.6))
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 4)
    for k, name in enumerate(("a field along x", "a field along y")):
        direction = turn[:, k]
        strength = np.linalg.norm(gradients @ direction, axis=1)
        draw_field(panels[k], face, strength, potential @ direction)
        panels[k].set_title(f"Strength of {name}")
    painted = draw_field(panels[2], face, face.vertex_strength, None)
    panels[2].set_title(r"$E_{\max}$ over all directions")
    panels[3].scatter(*points.T, s=8, c="#16324f")
    tips = points + ARROW * face.normals()
    panels[3].add_collection(LineCollection(list(np.stack([points, tips], axis=1)), colors="#d1495b", linewidths=1.0))
    panels[3].set_title("Normals")
    low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    for axes in panels:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[])
    figure.tight_layout(rect=(0.0, 0.08, 1.0, 1.0))
    bar = figure.colorbar(painted, cax=figure.add_axes((0.25, 0.09, 0.25, 0.03)), orientation="horizontal")
    bar.set_label("strength (unshielded space has 1)")
    picture = args.out / "plane.png"
    figure.savefig(picture, dpi=75)
    with Image.open(picture) as drawn:
        # Few colours: a third of the bytes.
        few = drawn.convert("RGB").quantize(160, kmeans=1)
    few.save(picture, optimize=True)
    print(f"plane.png: {args.points} points, {len(face.mesh.tets)} triangles")


if __name__ == "__main__":
    main()
