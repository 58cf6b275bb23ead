"""Triangles of the balls and of the box, volumes and orientation: what the meshers and their checks share."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from face_plugin.compiled import compiled
from face_plugin.faraday.balls import Balls
from face_plugin.faraday.domain import Box
from face_plugin.faraday.triangles import oriented_triangles, triangle_areas

__all__ = [
    "Boundary",
    "ball_volumes",
    "boundary_surface",
    "faces_of_solid",
    "oriented",
    "snapped_to_box",
    "tet_volumes",
]

# How far from the box a vertex still lies on it, relative to its longest side: a few rounding errors.
ON_BOX = 1e-12


@dataclass(frozen=True)
class Boundary:
    """Closed surfaces that bound the domain: the balls, then the box."""

    vertices: NDArray[np.float64]
    """(v, 3) those of the balls, ball by ball, then the box's eight corners."""
    faces: NDArray[np.int32]
    """(f, 3) triangles turned out of the domain: into the balls, and out of the box."""
    owner: NDArray[np.int32]
    """(f,) index of the ball that a triangle belongs to, -1 for the box."""


def tet_volumes(vertices: NDArray[np.float64], tets: NDArray[np.int32]) -> NDArray[np.float64]:
    """Signed volumes (t,) of tetrahedra, or areas of triangles.

    Examples
    --------
    >>> tet_volumes(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]], dtype=np.int32)).round(3)
    array([0.167])
    """
    if vertices.shape[1] == 2:
        return triangle_areas(vertices, tets)
    first, *others = (vertices[column] for column in tets.T)
    a, b, c = (other - first for other in others)
    return np.asarray(np.einsum("td,td->t", np.cross(a, b), c) / 6.0)


def oriented(
    vertices: NDArray[np.float64], tets: NDArray[np.int32], flat: float
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Tetrahedra (k, 4) turned positive, without those whose least height is at most `flat`, and their volumes (k,).

    Triangles (k, 3) of the plane alike.

    The vertex with the shortest edges comes first: differences from the far end of a needle would lose its
    volume, and with it its stiffness, to rounding.

    Examples
    --------
    >>> oriented(np.vstack([np.zeros(3), np.eye(3)]), np.array([[1, 0, 2, 3]], dtype=np.int32), 1e-14)[0]
    array([[0, 1, 2, 3]], dtype=int32)
    """
    if vertices.shape[1] == 2:
        return oriented_triangles(vertices, tets, flat)
    tets = np.array(tets, order="C")
    volume, height = np.empty((2, len(tets)))
    _turn(vertices, tets, volume, height)
    solid = height > flat
    return tets[solid], volume[solid]


@compiled(error_model="numpy")
def _turn(vertices, tets, volume, height):  # type: ignore[no-untyped-def]
    """Put the vertex with the shortest edges first, turn tetrahedra positive, and fill in volumes and least heights.

    A height is three volumes over the area of a facet.
    """
    for t in range(len(tets)):
        first, shortest = 0, math.inf
        for i in range(4):
            total = 0.0
            for j in range(4):
                for d in range(3):
                    off = vertices[tets[t, i], d] - vertices[tets[t, j], d]
                    total += off * off
            if total < shortest:
                first, shortest = i, total
        nearest = tets[t, first]
        tets[t, first] = tets[t, 0]
        tets[t, 0] = nearest
        largest = 0.0
        # The facets without vertex 3, 2, 1, 0; the first vertex of a facet is the nearest one where it has it.
        for without in range(3, -1, -1):
            a = tets[t, 1] if without == 0 else tets[t, 0]
            b = tets[t, 2] if without < 2 else tets[t, 1]
            c = tets[t, 3] if without < 3 else tets[t, 2]
            x, y, z = vertices[a, 0], vertices[a, 1], vertices[a, 2]
            bx, by, bz = vertices[b, 0] - x, vertices[b, 1] - y, vertices[b, 2] - z
            cx, cy, cz = vertices[c, 0] - x, vertices[c, 1] - y, vertices[c, 2] - z
            nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
            squared = nx * nx + ny * ny + nz * nz
            if squared > largest:
                largest = squared
            if without == 3:
                apex = tets[t, 3]
                signed = (
                    nx * (vertices[apex, 0] - x) + ny * (vertices[apex, 1] - y) + nz * (vertices[apex, 2] - z)
                ) / 6.0
                volume[t] = abs(signed)
                if signed < 0.0:
                    tets[t, 1], tets[t, 2] = c, b
        height[t] = 6.0 * volume[t] / math.sqrt(largest) if largest > 0.0 else 0.0


def faces_of_solid(balls: Balls) -> NDArray[np.int32]:
    """Triangles (k, 3) of one ball's solid, turned outward; the same numbers serve every ball.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> faces_of_solid(build_balls(np.eye(3), np.arange(3))).shape
    (8, 3)
    """
    return _outward_hull((balls.vertices[0] - balls.centres[0]) / balls.radii[0])


def ball_volumes(balls: Balls) -> NDArray[np.float64]:
    """Volume (b,) of each ball's solid, or area of its polygon.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> bool(np.allclose(ball_volumes(balls), 4 / 3 * balls.radii**3))
    True
    """
    unit = (balls.vertices[0] - balls.centres[0]) / balls.radii[0]
    return np.asarray(ConvexHull(unit).volume * balls.radii ** unit.shape[1])


def boundary_surface(balls: Balls, box: Box) -> Boundary:
    """Surfaces that a constrained mesher has to keep.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> from face_plugin.faraday.domain import padded_box
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> boundary_surface(balls, padded_box(balls, 0.1)).faces.shape
    (36, 3)
    """
    count, solid = balls.vertices.shape[:2]
    inward = faces_of_solid(balls)[:, ::-1]
    on_balls = (np.arange(count)[:, None, None] * solid + inward).reshape(-1, 3)
    corner = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    on_box = _outward_hull(corner - 0.5) + count * solid
    return Boundary(
        np.concatenate([balls.vertices.reshape(-1, 3), np.where(corner == 1, box.upper, box.lower)]),
        np.concatenate([on_balls, on_box]).astype(np.int32),
        np.concatenate([np.repeat(np.arange(count), len(inward)), np.full(len(on_box), -1)]).astype(np.int32),
    )


def snapped_to_box(vertices: NDArray[np.float64], box: Box) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Vertices (m, 3) of which those on the box are exactly on it, and which (m,) these are.

    A mesher puts vertices of its own on the box only up to rounding.

    Examples
    --------
    >>> unit = Box(np.zeros(3), np.ones(3))
    >>> vertices, on_box = snapped_to_box(np.array([[0.5, 0.5, 1 - 1e-15], [0.5, 0.5, 0.5]]), unit)
    >>> vertices[0], on_box
    (array([0.5, 0.5, 1. ]), array([ True, False]))
    """
    tolerance = ON_BOX * float((box.upper - box.lower).max())
    low, high = vertices - box.lower <= tolerance, box.upper - vertices <= tolerance
    snapped = np.where(low, box.lower, np.where(high, box.upper, vertices))
    return snapped, np.asarray((low | high).any(axis=1))


def _outward_hull(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Triangles of the convex hull of points around the origin, turned outward."""
    faces = ConvexHull(points).simplices
    a, b, c = (points[column] for column in faces.T)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return np.asarray(faces, dtype=np.int32)
