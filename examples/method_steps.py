"""What the method does to a cloud, step by step: all in one section through a cup with a box in a box inside.

    python examples/method_steps.py [--points N] [--out FOLDER]

Writes method_steps.png. The arrows of votes and normals are red where they point to the wrong side. Above them stands
how many point to the right one, and by how much their lines are off in the mean.
"""

from __future__ import annotations

import argparse
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from panels import save_small

from face_plugin import FaCE
from face_plugin.app.plot.section import Section
from face_plugin.shapes import cup, nested_box
from face_plugin.surface import poisson_reconstruction

RIGHT, WRONG, OTHER = "#2f5d8a", "#d9482b", "#c9c9ce"
STRAYS = 8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=9000)
    parser.add_argument("--out", type=Path, default=Path("."))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    save_small(drawn(args.points), args.out / "method_steps.png")


def drawn(count: int) -> Figure:
    points, truth, inside = cloud(count)
    # The cup lies on its side.
    section = Section.through(points[:count], up="x", axis="y")
    face = FaCE(points)
    votes, result = face.with_angles("field").normals(), face.result(filter_interior=True)
    # Lines of the votes, on the sides that were found in the end.
    sides = np.where((votes * result.normals).sum(axis=1)[:, None] < 0, -votes, votes)
    near = section.near(points, 0.03 * float(np.ptp(points[:count], axis=0).max()))
    flat = section.flatten(points)
    figure = Figure(figsize=(15.0, 4.6))
    panels = figure.subplots(2, 4).ravel()
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.01, top=0.94, wspace=0.03, hspace=0.12)

    panels[0].scatter(*flat[near].T, s=5, c=np.where(face.strays[near], WRONG, RIGHT))
    titled(panels[0], f"Points, and {int(face.strays.sum())} strays")
    vertices = face.frame.from_unit(face.mesh.vertices)
    draw_balls(panels[1], face, section)
    triangles = np.concatenate([face.mesh.tets[:, list(three)] for three in combinations(range(4), 3)])
    edges = section.outline(vertices, triangles)
    panels[2].add_collection(LineCollection(edges, colors="#55606c", linewidths=0.25))
    titled(panels[2], "Mesh")
    positions, extent = section.grid(points, 400, margin=0.03)
    strength = face.strength(positions.reshape(-1, 3)).reshape(positions.shape[:2])
    norm = LogNorm(1e-6, 2.0, clip=True)
    panels[3].imshow(np.maximum(strength, 1e-9), origin="lower", extent=extent, cmap="magma", norm=norm)
    titled(panels[3], "Field: E_max, from 1e-6 (black) to 1")
    named = (("Votes of the field", votes), ("Sides", sides), ("Angles", result.normals))
    # What lies inside has no side, and strays have none.
    sided = ~inside & truth.any(axis=1)
    shown = near & sided
    for axes, (name, normals) in zip(panels[4:7], named, strict=True):
        cosine = (normals * truth).sum(axis=1)
        right = cosine > 0
        off = np.degrees(np.arccos(np.minimum(np.abs(cosine[sided]), 1.0))).mean()
        arrows(axes, flat[shown], section.flatten(normals)[shown], right[shown])
        titled(axes, f"{name}: {100 * right[sided].mean():.1f} % right, lines {off:.1f} degrees off")
    mesh = poisson_reconstruction(points[result.kept], result.normals[result.kept])
    panels[7].add_collection(LineCollection(section.outline(mesh[0], mesh[1]), colors=RIGHT, linewidths=1.5))
    panels[7].scatter(*flat[near & result.interior].T, s=5, c=WRONG)
    titled(panels[7], "Interior points, left out, and the surface")
    low, high = extent[0::2], extent[1::2]
    for axes in panels:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    return figure


def cloud(count: int) -> tuple[Any, Any, Any]:
    """Return a cup, two boxes in one another within it, and strays around: points, normals, and which lie inside."""
    outer, inner = cup(count - count // 8), nested_box(count // 8)
    low, high = outer.points.min(axis=0), outer.points.max(axis=0)
    boxes = 0.5 * (low + high) + 0.24 * inner.points
    angle = 2 * np.pi * (np.arange(STRAYS) + 0.5) / STRAYS
    around = np.stack([1.1 * np.sin(angle), np.zeros(STRAYS), 0.8 * np.cos(angle)], axis=1)
    strays = 0.5 * (low + high) + around * (high - low)
    none = np.zeros((STRAYS, 3))
    points, normals = [outer.points, boxes, strays], [outer.normals, inner.normals, none]
    inside = [outer.interior, inner.interior, none[:, 0] > 0]
    return np.concatenate(points), np.concatenate(normals), np.concatenate(inside)


def draw_balls(axes: Any, face: FaCE, section: Section) -> None:
    """Draw the circles in which the section meets the balls."""
    centres, radii = face.frame.from_unit(face.balls.centres), face.balls.radii * face.frame.scale
    off = np.abs(centres[:, section.axis] - section.at)
    met = off < radii
    width = 2 * np.sqrt(radii[met] ** 2 - off[met] ** 2)
    circles = {"units": "xy", "offsets": section.flatten(centres)[met], "offset_transform": axes.transData}
    axes.add_collection(EllipseCollection(width, width, np.zeros(len(width)), facecolors=RIGHT, **circles))
    titled(axes, f"Cage: {len(radii):,} balls, those of the section")


def arrows(axes: Any, places: Any, directions: Any, right: Any) -> None:
    colours = np.where(right, RIGHT, WRONG)
    axes.quiver(*places.T, *directions.T, color=colours, angles="xy", scale=22, width=0.003)


def titled(axes: Any, title: str) -> None:
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.set_title(title, fontsize=10)
    axes.spines[:].set_color(OTHER)


if __name__ == "__main__":
    main()
