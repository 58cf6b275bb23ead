"""The winding number of oriented points in the plane: a sum of dipoles, by the tree of `face_plugin.winding`.

Of points p_j on curves, with normals n_j and lengths a_j, it is

    w(x) = 1 / (2 pi) sum_j a_j n_j . (p_j - x) / |p_j - x|^2:

the sum of the angles under which the pieces are seen, over a full turn. 1 inside, 0 outside, 1/2 on the curve.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.threads import in_threads
from face_plugin.tree import STACK, PointTree
from face_plugin.winding import DipoleTree

__all__ = ["PlaneTree"]


class PlaneTree(DipoleTree):
    """Points of the plane with lengths; the same calls and factors as in space.

    Parameters
    ----------
    points : (n, 2) float64 or PointTree
    lengths : (n,) float64, in the unit of the points

    Examples
    --------
    >>> angle = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    >>> circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    >>> tree = PlaneTree(circle, np.full(100, 2.0 * np.pi / 100))
    >>> tree.number(circle, np.full(2, 1e-3), np.array([[0.0, 0.0], [2.0, 0.0]])).round(2) + 0.0
    array([1., 0.])
    """

    opening = 0.3
    """As in space, for dipoles alone."""

    def _moments(self, dipoles: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._tree.sums(dipoles)

    def _add_sums(
        self,
        queries: PointTree,
        themselves: bool,
        dipoles: NDArray[np.float64],
        eps: NDArray[np.float64],
        moments: NDArray[np.float64],
        opening: float,
        out: NDArray[np.float64],
    ) -> None:
        tree = self._tree

        def run(rows: slice) -> None:
            _sums(
                rows.start, rows.stop, queries.points, themselves, tree.points, dipoles, eps, tree.start, tree.stop,
                tree.child, self._centre, self._radius, moments, opening, np.empty(STACK, dtype=np.int64), out,
            )  # fmt: skip

        in_threads(run, len(queries.points))


@compiled(nogil=True, error_model="numpy")
def _sums(  # type: ignore[no-untyped-def]
    first, last, queries, themselves, points, dipoles, eps, start, stop, child, centre, radius, moments, opening,
    stack, out,
):  # fmt: skip
    """Walk down the tree for each query: -2 pi grad w = sum_j m_j / r^2 - 2 (m_j . d) d / r^4, twice for 4 pi."""
    for i in range(first, last):
        if eps[i] == 0.0:
            continue
        x, y, squared = queries[i, 0], queries[i, 1], eps[i] * eps[i]
        gx, gy, w = 0.0, 0.0, 0.0
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            dx, dy = centre[node, 0] - x, centre[node, 1] - y
            distance = math.sqrt(dx * dx + dy * dy)
            if radius[node] < opening * distance:
                inverse = 1.0 / (dx * dx + dy * dy + squared)
                along = (dx * moments[node, 0] + dy * moments[node, 1]) * inverse
                w += along
                gx += moments[node, 0] * inverse - 2.0 * along * inverse * dx
                gy += moments[node, 1] * inverse - 2.0 * along * inverse * dy
            elif child[node] >= 0:
                stack[top] = child[node]
                stack[top + 1] = child[node] + 1
                top += 2
            else:
                for k in range(start[node], stop[node]):
                    if themselves and k == i:
                        continue
                    dx, dy = points[k, 0] - x, points[k, 1] - y
                    inverse = 1.0 / (dx * dx + dy * dy + squared)
                    along = (dx * dipoles[k, 0] + dy * dipoles[k, 1]) * inverse
                    w += along
                    gx += dipoles[k, 0] * inverse - 2.0 * along * inverse * dx
                    gy += dipoles[k, 1] * inverse - 2.0 * along * inverse * dy
        out[i, 0], out[i, 1], out[i, 3] = 2.0 * gx, 2.0 * gy, 2.0 * w
