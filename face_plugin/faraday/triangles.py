"""What is of the plane alone: triangles in the place of tetrahedra, and two basis fields in the place of three.

Linear finite elements are the same in any dimension: the gradients of a cell's shape functions, its size, and their
products. For tetrahedra they are compiled loops; a curve has so few triangles that array expressions do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

__all__ = [
    "half_circle",
    "oriented_triangles",
    "shape_gradients",
    "strength_in_plane",
    "triangle_areas",
    "triangle_stiffness",
    "triangle_vertex_gradients",
]

# As many directions as the paper takes in space.
DIRECTIONS = 6


def triangle_areas(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    """Signed areas (t,) of triangles (t, 3), positive where they turn to the left.

    Examples
    --------
    >>> triangle_areas(np.array([[0.0, 0], [1, 0], [0, 1]]), np.array([[0, 1, 2]], dtype=np.int32))
    array([0.5])
    """
    first, second, third = (vertices[column] for column in triangles.T)
    a, b = second - first, third - first
    return np.asarray(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))


def oriented_triangles(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], flat: float
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Triangles (k, 3) turned to the left, without those whose least height is at most `flat`, and their areas (k,).

    Examples
    --------
    >>> oriented_triangles(np.array([[0.0, 0], [1, 0], [0, 1]]), np.array([[0, 2, 1]], dtype=np.int32), 1e-14)
    (array([[0, 1, 2]], dtype=int32), array([0.5]))
    """
    area = triangle_areas(vertices, triangles)
    turned = np.where((area < 0)[:, None], triangles[:, [0, 2, 1]], triangles)
    corners = vertices[turned]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    solid = 2.0 * np.abs(area) > flat * longest
    return np.ascontiguousarray(turned[solid]), np.abs(area[solid])


def shape_gradients(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gradients (t, 3, 2) of the linear shape functions of triangles, and their areas (t,).

    Examples
    --------
    >>> shape_gradients(np.array([[0.0, 0], [1, 0], [0, 1]]), np.array([[0, 1, 2]], dtype=np.int32))[0][0] + 0.0
    array([[-1., -1.],
           [ 1.,  0.],
           [ 0.,  1.]])
    """
    corners = vertices[triangles]
    area = triangle_areas(vertices, triangles)
    # The gradient at a corner is the edge opposite to it, turned by a right angle, over two areas.
    edge = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)
    turned = np.stack([-edge[:, :, 1], edge[:, :, 0]], axis=2)
    return turned / (2.0 * area)[:, None, None], area


def triangle_stiffness(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], column: NDArray[np.int64], free: int, width: int
) -> sparse.csr_matrix:
    """Rows (free, width) of the cotangent Laplacian; `column` (m,) names each vertex's row and column.

    Rows from `free` on are left out, as `face_plugin.faraday.poisson.stiffness` wants it.
    """
    gradient, area = shape_gradients(vertices, triangles)
    local = area[:, None, None] * np.einsum("tid,tjd->tij", gradient, gradient)
    row = np.repeat(column[triangles], 3, axis=1).ravel()
    across = np.tile(column[triangles], (1, 3)).ravel()
    kept = row < free
    entries = (local.ravel()[kept], (row[kept], across[kept]))
    return sparse.csr_matrix(sparse.coo_matrix(entries, shape=(free, width)))


def triangle_vertex_gradients(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Gradients (m, 2, s) of functions (m, s), averaged at each vertex over its triangles by area."""
    gradient, area = shape_gradients(vertices, triangles)
    of_triangle = np.einsum("tid,tis->tds", gradient, values[triangles]) * area[:, None, None]
    corner, count = triangles.ravel(), len(vertices)
    weight = np.bincount(corner, np.repeat(area, 3), minlength=count)
    flat = np.repeat(of_triangle.reshape(len(triangles), -1), 3, axis=0)
    total = np.stack([np.bincount(corner, column, minlength=count) for column in flat.T], axis=1)
    mean = total / np.where(weight > 0, weight, 1.0)[:, None]
    return np.asarray(mean.reshape(count, 2, values.shape[1]))


def strength_in_plane(gradients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest singular value (m,) of each matrix (m, 2, 2).

    Examples
    --------
    >>> strength_in_plane(np.diag([1.0, -3.0])[None])
    array([3.])
    """
    (a, b), (c, d) = gradients[:, 0].T, gradients[:, 1].T
    # Half the sum of the singular values, and half their difference (with the sign of the determinant).
    return np.asarray(0.5 * (np.hypot(a + d, b - c) + np.hypot(a - d, b + c)))


def half_circle() -> NDArray[np.float64]:
    """Six directions (6, 2) of the plane, one of each pair of opposite ones: what six are in space.

    Examples
    --------
    >>> half_circle().shape
    (6, 2)
    """
    angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)
