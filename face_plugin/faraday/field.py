"""The electric field: gradients of the potentials, and the greatest strength that any external field causes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.faraday.meshers import CageMesh

__all__ = ["half_icosahedron", "strength", "strength_exact", "strength_of_directions", "vertex_gradients"]


def vertex_gradients(mesh: CageMesh, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Gradients of piecewise linear functions, averaged at each vertex over its tetrahedra by volume (paper 3.3).

    Parameters
    ----------
    mesh : CageMesh
    values : (m, s) float64
        A column a function.

    Returns
    -------
    (m, 3, s) float64
        Column k holds the gradient of function k. Zero at a vertex that no tetrahedron uses.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> mesh = CageMesh(corners, np.array([[0, 1, 2, 3]], dtype=np.int32), *4 * [np.empty(0)])
    >>> vertex_gradients(mesh, corners @ np.array([[1.0], [2.0], [3.0]]))[0].ravel()
    array([1., 2., 3.])
    """
    return np.asarray(_vertex_gradients(mesh.vertices, mesh.tets, np.ascontiguousarray(values)))


@compiled()
def _vertex_gradients(vertices, tets, values):  # type: ignore[no-untyped-def]
    scenarios = values.shape[1]
    out = np.zeros((len(vertices), 3, scenarios))
    weight = np.zeros(len(vertices))
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
        for v in (p, q, r, s):
            weight[v] += six
        for k in range(scenarios):
            base = values[p, k]
            dq, dr, ds = values[q, k] - base, values[r, k] - base, values[s, k] - base
            gx = n1x * dq + n2x * dr + n3x * ds
            gy = n1y * dq + n2y * dr + n3y * ds
            gz = n1z * dq + n2z * dr + n3z * ds
            for v in (p, q, r, s):
                out[v, 0, k] += gx
                out[v, 1, k] += gy
                out[v, 2, k] += gz
    for v in range(len(vertices)):
        if weight[v] > 0:
            out[v] /= weight[v]
    return out


def strength_exact(gradients: NDArray[np.float64]) -> NDArray[np.float64]:
    """E_max over all directions: the largest singular value of each 3x3 matrix of gradients.

    The potential is linear in the direction v of the external field, so with the three basis solutions in the columns
    of G its field is G v, and ``max |G v|`` over unit v is the largest singular value of G: the limit of paper
    equation 5 for infinitely many directions, at the price of three.

    Parameters
    ----------
    gradients : (m, 3, 3) float64

    Returns
    -------
    (m,) float64

    Examples
    --------
    >>> strength_exact(np.diag([1.0, -3.0, 2.0])[None])
    array([3.])
    """
    return np.asarray(_strength_exact(np.ascontiguousarray(gradients)))


@compiled()
def _strength_exact(gradients):  # type: ignore[no-untyped-def]
    """Largest eigenvalue of G^T G from the trigonometric solution of its characteristic cubic."""
    out = np.empty(len(gradients))
    for i in range(len(gradients)):
        g = gradients[i]
        # Scalars throughout, as above.
        m00 = g[0, 0] * g[0, 0] + g[1, 0] * g[1, 0] + g[2, 0] * g[2, 0]
        m11 = g[0, 1] * g[0, 1] + g[1, 1] * g[1, 1] + g[2, 1] * g[2, 1]
        m22 = g[0, 2] * g[0, 2] + g[1, 2] * g[1, 2] + g[2, 2] * g[2, 2]
        m01 = g[0, 0] * g[0, 1] + g[1, 0] * g[1, 1] + g[2, 0] * g[2, 1]
        m02 = g[0, 0] * g[0, 2] + g[1, 0] * g[1, 2] + g[2, 0] * g[2, 2]
        m12 = g[0, 1] * g[0, 2] + g[1, 1] * g[1, 2] + g[2, 1] * g[2, 2]
        q = (m00 + m11 + m22) / 3.0
        off = m01**2 + m02**2 + m12**2
        p = np.sqrt(((m00 - q) ** 2 + (m11 - q) ** 2 + (m22 - q) ** 2 + 2.0 * off) / 6.0)
        largest = q
        if p > 1e-14 * q:
            b00, b11, b22 = (m00 - q) / p, (m11 - q) / p, (m22 - q) / p
            b01, b02, b12 = m01 / p, m02 / p, m12 / p
            half = 0.5 * (b00 * (b11 * b22 - b12 * b12) - b01 * (b01 * b22 - b12 * b02) + b02 * (b01 * b12 - b11 * b02))
            largest = q + 2.0 * p * np.cos(np.arccos(min(1.0, max(-1.0, half))) / 3.0)
        out[i] = np.sqrt(max(largest, 0.0))
    return out


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
    """E_max (m,) at the vertices from the three basis potentials (m, 3); `directions` as in `Params`."""
    gradients = vertex_gradients(mesh, potential)
    if directions == "exact":
        return strength_exact(gradients)
    return strength_of_directions(gradients, half_icosahedron())
