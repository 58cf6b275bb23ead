"""Two shapes of the paper's studies: a spiral wall of varying thickness, and a flask whose inside is shielded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from truth import Array, Case

from face_plugin import shapes
from face_plugin.shapes.shape import from_solids
from face_plugin.shapes.solids import Solid, arc, line

# Candidates a point kept, as in `face_plugin.shapes`.
OVERSAMPLING = 6


def spiral(
    n: int, seed: int = 0, *, turns: float = 2.5, pitch: float = 0.3, thickness: tuple[float, float] = (0.02, 0.16)
) -> tuple[Case, Array]:
    """Archimedean spiral, extruded: a wall whose thickness grows along it (the paper's figure 13).

    Returns the case, and the thickness (n,) of the wall at each point.
    """
    angle = np.linspace(0.0, 2 * np.pi * turns, 1500)
    radius = 0.15 + pitch * angle / (2 * np.pi)
    centre = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    along = np.gradient(centre, angle, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.column_stack([along[:, 1], -along[:, 0]])
    wall = np.linspace(*thickness, len(angle))
    outer, inner = centre + 0.5 * wall[:, None] * side, centre - 0.5 * wall[:, None] * side
    height = 0.25
    outline = np.concatenate([outer, inner[::-1]])
    count = len(outline)
    vertices = np.concatenate(
        [np.column_stack([outline, np.full(count, -height)]), np.column_stack([outline, np.full(count, height)])]
    )
    i = np.arange(count)
    j = (i + 1) % count
    sides = np.concatenate([np.column_stack([i, j, j + count]), np.column_stack([i, j + count, i + count])])
    k = np.arange(len(angle) - 1)
    strip = np.concatenate(
        [
            np.column_stack([k, k + 1, count - 2 - k]),
            np.column_stack([k, count - 2 - k, count - 1 - k]),
        ]
    )
    faces = np.concatenate([sides, strip[:, ::-1], strip + count])
    points, normals = sample(vertices, faces, n, seed)
    nearest = np.argmin(np.linalg.norm(points[:, None, :2] - centre[None, ::10], axis=2), axis=1)
    case = Case("spiral", points, normals, np.ones(n, dtype=np.bool_), clean=False)
    return case, wall[::10][nearest]


def flask(n: int, seed: int = 0, *, opening: float = 50.0, wall: float = 0.15) -> Case:
    """Hollow ball with a round opening of so many degrees to each side: its inside is shielded (figure 14)."""
    inner, edge = 1.0 - wall, np.radians(90.0 - opening)
    rim = [(r * float(np.cos(edge)), r * float(np.sin(edge))) for r in (1.0, inner)]
    solid = Solid(
        (
            arc((0.0, 0.0), 1.0, -np.pi / 2, float(edge)),
            line(rim[0], rim[1]),
            arc((0.0, 0.0), inner, -np.pi / 2, float(edge), hollow=True),
        ),
        lambda p: np.ones(len(p)),
    )
    shape = from_solids([solid], n, seed)
    return Case(f"flask of {n} points", shape.points, shape.normals, np.ones(n, dtype=np.bool_), clean=False)


def sample(vertices: Array, faces: NDArray[np.int64], n: int, seed: int) -> tuple[Array, Array]:
    """Even sample (n, 3) of a triangle mesh, and the normals there."""
    rng = np.random.default_rng(seed)
    a, b, c = (vertices[column] for column in faces.T)
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    chosen = rng.choice(len(faces), OVERSAMPLING * n, p=area / area.sum())
    s, t = np.sqrt(rng.random((len(chosen), 1))), rng.random((len(chosen), 1))
    points = (1 - s) * a[chosen] + s * (1 - t) * b[chosen] + s * t * c[chosen]
    normals = normal[chosen] / area[chosen, None]
    kept = shapes.evenly(points, n, rng, normals=normals)
    return points[kept], normals[kept]
