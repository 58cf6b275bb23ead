"""Tetrahedral meshes and checks of triangle meshes for the tests of the isosurface and of what uses it."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree
from scipy.spatial.transform import Rotation

from face_plugin.faraday.meshers import CageMesh


def grid_mesh(n: int, rotation: Rotation | None = None) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Cut each of the n^3 cells of the cube [-1, 1]^3 into the six tetrahedra of Kuhn's subdivision."""
    axis = np.linspace(-1, 1, n + 1)
    vertices = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    tets = []
    for order in itertools.permutations(range(3)):
        path = np.tri(4, 3, -1, dtype=int)[:, order]
        if np.linalg.det(np.diff(path, axis=0)) < 0:
            path = path[[1, 0, 2, 3]]
        tets.append(np.stack([index[i : n + i, j : n + j, k : n + k].ravel() for i, j, k in path], axis=1))
    if rotation is not None:
        vertices = rotation.apply(vertices)
    return vertices, np.concatenate(tets).astype(np.int32)


def cage_mesh(points: NDArray[np.float64], rng: np.random.Generator, free: int = 2000) -> CageMesh:
    """Mesh the space around octahedral balls at the points, out to a sphere.

    The sphere stands in for the box: Qhull makes flat tetrahedra out of points that share a plane.
    """
    radius = 0.45 * KDTree(points).query(points, k=2)[0][:, 1]
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    turned = np.stack([turn.apply(corners) for turn in Rotation.random(len(points), random_state=rng)])
    cage = (points[:, None] + radius[:, None, None] * turned).reshape(-1, 3)
    middle, reach = points.mean(axis=0), 2 * np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    box = rng.normal(size=(400, 3))
    box = middle + reach * box / np.linalg.norm(box, axis=1, keepdims=True)
    inner = middle + rng.uniform(-0.5, 0.5, size=(free, 3)) * reach
    # A free vertex inside the sphere of a ball would break the ball's convex hull.
    near, ball = KDTree(points).query(inner)
    inner = inner[near > 1.1 * radius[ball]]
    vertices = np.concatenate([cage, box, inner])
    owner = np.full(len(vertices), -1, dtype=np.int32)
    owner[: len(cage)] = np.repeat(np.arange(len(points)), 6)
    boundary = np.zeros(len(vertices), dtype=bool)
    boundary[len(cage) : len(cage) + len(box)] = True
    tets = Delaunay(vertices).simplices
    inside = (owner[tets] == owner[tets[:, :1]]).all(axis=1) & (owner[tets[:, 0]] >= 0)
    tets = tets[~inside]
    negative = tet_volumes(vertices, tets) < 0
    tets[negative] = tets[negative][:, [1, 0, 2, 3]]
    box = vertices.min(axis=0), vertices.max(axis=0)
    return CageMesh(vertices, tets.astype(np.int32), owner, boundary, *box)


def tet_volumes(vertices: NDArray[np.float64], tets: NDArray[np.integer]) -> NDArray[np.float64]:
    a, b, c, d = (vertices[column] for column in tets.T)
    return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6


def triangle_normals(v: NDArray[np.float64], f: NDArray[np.int64]) -> NDArray[np.float64]:
    """Give normals as long as twice the area."""
    return np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])


def enclosed_volume(v: NDArray[np.float64], f: NDArray[np.int64]) -> float:
    return float(np.einsum("ij,ij->", v[f[:, 0]], np.cross(v[f[:, 1]], v[f[:, 2]])) / 6)


def open_edges(f: NDArray[np.int64]) -> int:
    """Count the directed edges that occur twice or more, or whose reverse does not occur."""
    directed = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    edges, count = np.unique(directed, axis=0, return_counts=True)
    known = set(map(tuple, edges.tolist()))
    return int((count > 1).sum()) + sum((b, a) not in known for a, b in known)
