"""The equations of the paper, word for word and slowly: dense matrices, one tetrahedron after the other.

Nothing here is shared with the package: shape functions come from 4x4 inverses, the conductor is carried as
an unknown of the system, maxima over directions are taken over directions.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from face_plugin.faraday.meshers import CageMesh

Array = NDArray[np.float64]


def shape_gradients(corners: Array) -> tuple[Array, float]:
    """Gradients (4, 3) of the linear shape functions of a tetrahedron, and its volume."""
    coefficients = np.linalg.inv(np.column_stack([np.ones(4), corners]))
    return coefficients[1:].T, abs(np.linalg.det(corners[1:] - corners[0])) / 6


def laplacian(mesh: CageMesh) -> Array:
    """Cotangent Laplacian of all vertices (m, m)."""
    L = np.zeros((len(mesh.vertices), len(mesh.vertices)))
    for tet in mesh.tets:
        gradients, volume = shape_gradients(mesh.vertices[tet])
        L[np.ix_(tet, tet)] += volume * gradients @ gradients.T
    return L


def solve(mesh: CageMesh, box_values: Array) -> Array:
    """Equation 4: potentials (m, s), the vertices of the cage collapsed into one unknown."""
    free = np.flatnonzero((mesh.owner < 0) & ~mesh.boundary)
    cage = np.flatnonzero(mesh.owner >= 0)
    collapse = np.zeros((len(mesh.vertices), len(free) + 1))
    collapse[free, np.arange(len(free))] = 1.0
    collapse[cage, -1] = 1.0
    given = np.zeros((len(mesh.vertices), box_values.shape[1]))
    given[mesh.boundary] = box_values
    L = laplacian(mesh)
    return collapse @ np.linalg.solve(collapse.T @ L @ collapse, -collapse.T @ L @ given) + given


def vertex_gradients(mesh: CageMesh, values: Array) -> Array:
    """Gradients (m, 3, s), averaged at vertices over their tetrahedra by volume (section 3.3)."""
    total = np.zeros((len(mesh.vertices), 3, values.shape[1]))
    weight = np.zeros(len(mesh.vertices))
    for tet in mesh.tets:
        gradients, volume = shape_gradients(mesh.vertices[tet])
        total[tet] += volume * gradients.T @ values[tet]
        weight[tet] += volume
    return total / weight[:, None, None]


def strength(mesh: CageMesh, potential: Array, directions: Array) -> Array:
    """Equation 5: the greatest norm of the field that any of the directions (d, 3) causes."""
    gradients = vertex_gradients(mesh, potential)
    return np.max([np.linalg.norm(gradients @ v, axis=1) for v in directions], axis=0)


def normals(mesh: CageMesh, field_strength: Array) -> Array:
    """Equation 6: the gradient of the strength, averaged over the vertices of each ball."""
    gradients = vertex_gradients(mesh, field_strength[:, None])[:, :, 0]
    mean = np.array([gradients[mesh.owner == k].mean(axis=0) for k in range(mesh.owner.max() + 1)])
    return mean / np.linalg.norm(mean, axis=1, keepdims=True)


def directions(count: int) -> Array:
    """Evenly spread unit vectors: a Fibonacci spiral on the sphere."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def icosphere(levels: int) -> Array:
    """Vertices of an icosahedron whose edges are halved `levels` times, on the unit sphere."""
    golden = (1 + 5**0.5) / 2
    corners = [np.roll((0.0, a, b * golden), k) for k in range(3) for a in (-1, 1) for b in (-1, 1)]
    points = np.array(corners) / np.hypot(1, golden)
    edge = 2 / np.hypot(1, golden)
    for _ in range(levels):
        pairs = [
            (i, j)
            for i, j in itertools.combinations(range(len(points)), 2)
            if np.linalg.norm(points[i] - points[j]) < 1.4 * edge
        ]
        middles = np.array([points[i] + points[j] for i, j in pairs])
        points = np.concatenate([points, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
        edge /= 2
    return points


def winding_sums(points: Array, normals: Array, areas: Array, eps: Array) -> tuple[Array, Array]:
    """-4 pi grad w (n, 3) and w (n,) at the points, each without itself, by the formulas of `face_plugin.winding`."""
    d = points[None] - points[:, None]
    r2 = (d**2).sum(axis=2) + eps[:, None] ** 2
    m = areas[:, None] * normals
    along = np.einsum("ijk,jk->ij", d, m)
    np.fill_diagonal(r2, np.inf)
    gradient = (m[None] / r2[..., None] ** 1.5 - 3 * along[..., None] * d / r2[..., None] ** 2.5).sum(axis=1)
    return gradient, (along / r2**1.5).sum(axis=1) / (4 * np.pi)
