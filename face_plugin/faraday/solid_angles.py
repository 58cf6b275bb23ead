"""The winding number of a surface of triangles: the solid angles they are seen under, those of far ones by a tree.

It is 1 / (4 pi) times the sum of the signed solid angles of all triangles (Jacobson et al. 2013): 1 inside a closed
surface whose normals point outwards, 0 outside, and in between near a hole. Triangles far away act together, as one
dipole and its first moments at their middle (Barill et al. 2018); near ones have their exact angle (Van Oosterom and
Strackee 1983).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.threads import in_threads
from face_plugin.tree import STACK, PointTree

__all__ = ["winding_number"]

# Triangles act together where their radius is below this fraction of the distance: at most 0.02 off the exact sum on a
# sphere of 120,000 triangles (0.4: 0.05), next to a threshold that is 0.1 below the number inside.
OPENING = 0.3


def winding_number(
    positions: NDArray[np.float64], corners: NDArray[np.float64], faces: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Winding number (k,) of a surface at positions (k, 3).

    Parameters
    ----------
    positions : (k, 3) float64
    corners : (c, 3) float64
        In the unit of the positions.
    faces : (q, 3) int64
        At least one; rows of corners, counterclockwise as seen from outside.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> winding_number(np.array([[0.1, 0.1, 0.1], [0.4, 0.4, 0.4]]), corners, faces).round(6) + 0.0
    array([1., 0.])
    """
    a, b, c = (corners[column] for column in faces.T)
    tree = PointTree((a + b + c) / 3.0)
    triangles = np.stack([a, b, c], axis=1)[tree.order]
    dipoles = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    weight = np.linalg.norm(dipoles, axis=1, keepdims=True) + np.finfo(np.float64).tiny
    centre = tree.sums(weight * tree.points) / tree.sums(weight)
    # A triangle reaches beyond its own middle.
    reach = np.linalg.norm(triangles - tree.points[:, None], axis=2).max(axis=1)
    runs = np.stack([tree.start, tree.stop], axis=1).ravel()
    radius = tree.radii(centre) + np.maximum.reduceat(np.append(reach, 0.0), runs)[::2]
    # Of the first moments sum_j m_j (p_j - c)^T of each node all nine, from those about one place.
    middle = centre[0]
    outer = np.einsum("ni,nj->nij", dipoles, tree.points - middle).reshape(-1, 9)
    moments = tree.sums(np.concatenate([dipoles, outer], axis=1))
    moments[:, 3:] -= np.einsum("mi,mj->mij", moments[:, :3], centre - middle).reshape(-1, 9)
    angle = np.empty(len(positions))

    def run(rows: slice) -> None:
        _solid_angles(
            rows.start, rows.stop, positions, triangles, tree.start, tree.stop, tree.child, centre, radius, moments,
            OPENING, np.empty(STACK, dtype=np.int64), angle,
        )  # fmt: skip

    in_threads(run, len(positions))
    return angle / (4.0 * np.pi)


@compiled(nogil=True, error_model="numpy")
def _solid_angles(  # type: ignore[no-untyped-def]
    first, last, positions, triangles, start, stop, child, centre, radius, moments, opening, stack, angle
):
    """Sum up solid angles at each position x.

    Of a triangle with corners a, b, c seen from x: ``tan(angle / 2) = det(a, b, c) / (|a| |b| |c| + (a.b) |c| +
    (b.c) |a| + (c.a) |b|)``. Of a far node with its middle at d from x, the sum m of its dipoles and S of its first
    moments: ``(m . d + tr S) / |d|^3 - 3 d . S d / |d|^5``.
    """
    for i in range(first, last):
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        total, top = 0.0, 1
        stack[0] = 0
        while top > 0:
            top -= 1
            node = stack[top]
            d0, d1, d2 = centre[node, 0] - x, centre[node, 1] - y, centre[node, 2] - z
            squared = d0 * d0 + d1 * d1 + d2 * d2
            if radius[node] * radius[node] < opening * opening * squared:
                along, bent, trace = 0.0, 0.0, 0.0
                for j in range(3):
                    dj = d0 if j == 0 else d1 if j == 1 else d2
                    along += moments[node, j] * dj
                    bent += (moments[node, 3 + j] * d0 + moments[node, 6 + j] * d1 + moments[node, 9 + j] * d2) * dj
                    trace += moments[node, 3 + 4 * j]
                total += (along + trace - 3.0 * bent / squared) / (squared * math.sqrt(squared))
                continue
            if child[node] >= 0:
                stack[top] = child[node]
                stack[top + 1] = child[node] + 1
                top += 2
                continue
            for t in range(start[node], stop[node]):
                a0, a1, a2 = triangles[t, 0, 0] - x, triangles[t, 0, 1] - y, triangles[t, 0, 2] - z
                b0, b1, b2 = triangles[t, 1, 0] - x, triangles[t, 1, 1] - y, triangles[t, 1, 2] - z
                c0, c1, c2 = triangles[t, 2, 0] - x, triangles[t, 2, 1] - y, triangles[t, 2, 2] - z
                a = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
                b = math.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
                c = math.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
                volume = a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0)
                total += 2.0 * math.atan2(
                    volume,
                    a * b * c
                    + (a0 * b0 + a1 * b1 + a2 * b2) * c
                    + (b0 * c0 + b1 * c1 + b2 * c2) * a
                    + (c0 * a0 + c1 * a1 + c2 * a2) * b,
                )
        angle[i] = total
