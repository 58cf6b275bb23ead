"""The electric field: gradients of the potentials, and the greatest strength that any external field causes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.triangles import half_circle, strength_in_plane, triangle_vertex_gradients

__all__ = ["half_icosahedron", "strength", "strength_exact", "strength_of_directions", "vertex_gradients"]


def vertex_gradients(mesh: CageMesh, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Gradients of piecewise linear functions, averaged at each vertex over its tetrahedra by volume (paper 3.3).

    In the plane over its triangles, by area.

    Parameters
    ----------
    mesh : CageMesh
    values : (m, s) float64
        A column a function.

    Returns
    -------
    (m, d, s) float64
        Column k holds the gradient of function k. Zero at a vertex that no tetrahedron uses.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> mesh = CageMesh(corners, np.array([[0, 1, 2, 3]], dtype=np.int32), *4 * [np.empty(0)])
    >>> vertex_gradients(mesh, corners @ np.array([[1.0], [2.0], [3.0]]))[0].ravel()
    array([1., 2., 3.])
    """
    if mesh.vertices.shape[1] == 2:
        return triangle_vertex_gradients(mesh.vertices, mesh.tets, values)
    out = np.zeros((len(mesh.vertices), 3, values.shape[1]))
    weight = np.zeros(len(mesh.vertices))
    _add_gradients(mesh.vertices, mesh.tets, np.ascontiguousarray(values), out, weight)
    used = weight > 0
    out[used] /= weight[used, None, None]
    return out


@compiled()
def _add_gradients(vertices, tets, values, out, weight):  # type: ignore[no-untyped-def]
    # Scalars throughout: an array for each edge vector would be allocated on the heap, and take four times as long.
    for t in range(len(tets)):
        p, q, r, s = tets[t, 0], tets[t, 1], tets[t, 2], tets[t, 3]
        x, y, z = vertices[p, 0], vertices[p, 1], vertices[p, 2]
        ax, ay, az = vertices[q, 0] - x, vertices[q, 1] - y, vertices[q, 2] - z
        bx, by, bz = vertices[r, 0] - x, vertices[r, 1] - y, vertices[r, 2] - z
        cx, cy, cz = vertices[s, 0] - x, vertices[s, 1] - y, vertices[s, 2] - z
        n1x, n1y, n1z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        n2x, n2y, n2z = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        n3x, n3y, n3z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        # Six volumes times the gradient: the volume weight needs no division.
        six = ax * n1x + ay * n1y + az * n1z
        for i in range(4):
            weight[tets[t, i]] += six
        for k in range(values.shape[1]):
            base = values[p, k]
            dq, dr, ds = values[q, k] - base, values[r, k] - base, values[s, k] - base
            gx = n1x * dq + n2x * dr + n3x * ds
            gy = n1y * dq + n2y * dr + n3y * ds
            gz = n1z * dq + n2z * dr + n3z * ds
            for i in range(4):
                v = tets[t, i]
                out[v, 0, k] += gx
                out[v, 1, k] += gy
                out[v, 2, k] += gz


def strength_exact(gradients: NDArray[np.float64]) -> NDArray[np.float64]:
    """E_max over all directions: the largest singular value of each matrix of gradients, 3x3, or 2x2 in the plane.

    The potential is linear in the direction v of the external field, so with the three basis solutions in the columns
    of G its field is G v, and ``max |G v|`` over unit v is the largest singular value of G: the limit of paper
    equation 5 for infinitely many directions, at the price of three; in the plane, of two.

    Parameters
    ----------
    gradients : (m, d, d) float64

    Returns
    -------
    (m,) float64

    Examples
    --------
    >>> strength_exact(np.diag([1.0, -3.0, 2.0])[None])
    array([3.])
    """
    if gradients.shape[1] == 2:
        return strength_in_plane(gradients)
    out = np.empty(len(gradients))
    _strength_exact(np.ascontiguousarray(gradients), out)
    return out


@compiled(error_model="numpy")
def _strength_exact(g, out):  # type: ignore[no-untyped-def]
    """Largest eigenvalue of G^T G from the trigonometric solution of its characteristic cubic."""
    for i in range(len(g)):
        # Scalars throughout, as above; and each element is read once, since every access takes time to compile.
        ax, ay, az = g[i, 0, 0], g[i, 1, 0], g[i, 2, 0]
        bx, by, bz = g[i, 0, 1], g[i, 1, 1], g[i, 2, 1]
        cx, cy, cz = g[i, 0, 2], g[i, 1, 2], g[i, 2, 2]
        m00 = ax * ax + ay * ay + az * az
        m11 = bx * bx + by * by + bz * bz
        m22 = cx * cx + cy * cy + cz * cz
        m01 = ax * bx + ay * by + az * bz
        m02 = ax * cx + ay * cy + az * cz
        m12 = bx * cx + by * cy + bz * cz
        q = (m00 + m11 + m22) / 3.0
        off = m01 * m01 + m02 * m02 + m12 * m12
        d00, d11, d22 = m00 - q, m11 - q, m22 - q
        p = math.sqrt((d00 * d00 + d11 * d11 + d22 * d22 + 2.0 * off) / 6.0)
        largest = q
        if p > 1e-14 * q:
            b00, b11, b22 = d00 / p, d11 / p, d22 / p
            b01, b02, b12 = m01 / p, m02 / p, m12 / p
            half = 0.5 * (b00 * (b11 * b22 - b12 * b12) - b01 * (b01 * b22 - b12 * b02) + b02 * (b01 * b12 - b11 * b02))
            # Rounding may carry the cosine past 1.
            if half > 1.0:
                half = 1.0
            elif half < -1.0:
                half = -1.0
            largest = q + 2.0 * p * math.cos(math.acos(half) / 3.0)
        out[i] = math.sqrt(largest) if largest > 0.0 else 0.0


def half_icosahedron() -> NDArray[np.float64]:
    """Return the paper's six directions (6, 3): one of each antipodal pair of an icosahedron's vertices (section 3.2).

    Examples
    --------
    >>> half_icosahedron().shape
    (6, 3)
    """
    from face_plugin.faraday.balls import SOLIDS

    vertices = SOLIDS["icosahedron"]
    return np.asarray(vertices[(vertices @ np.array([1.0, 0.1, 0.01])) > 0])


def strength_of_directions(gradients: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """E_max over given unit directions (d, 3): ``max |G v|`` (paper equation 5).

    Examples
    --------
    >>> strength_of_directions(np.diag([1.0, -3.0, 2.0])[None], np.eye(3)[2:])
    array([2.])
    """
    out = np.zeros(len(gradients))
    for v in directions:
        np.maximum(out, np.linalg.norm(gradients @ v, axis=1), out=out)
    return out


def strength(mesh: CageMesh, potential: NDArray[np.float64], directions: str) -> NDArray[np.float64]:
    """E_max (m,) at the vertices from the basis potentials (m, d); `directions` as in `Params`."""
    gradients = vertex_gradients(mesh, potential)
    if directions == "exact":
        return strength_exact(gradients)
    paper = half_circle() if gradients.shape[1] == 2 else half_icosahedron()
    return strength_of_directions(gradients, paper)
