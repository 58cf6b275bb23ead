"""The winding-number field of oriented points: a sum of dipoles, by a tree.

The winding number at x of points p_j with area-weighted normals a_j n_j is (Barill et al. 2018, equation 2)

    w(x) = 1 / (4 pi) sum_j a_j n_j . (p_j - x) / |p_j - x|^3.

It is 1 inside, 0 outside, and its gradient at the surface is the inward normal. Kernels are regularised,
|p_j - x|^2 + eps^2, and far groups of points act as one dipole and its first moments at their centre.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.threads import in_threads
from face_plugin.tree import STACK, PointTree

__all__ = ["DipoleTree"]

# What is larger in the widths of a kernel lies too far away to matter, and would leave single precision.
LARGEST = 1e36
# Sources added at a time: a list stays in the first cache.
LIST = 512


class DipoleTree:
    """Points with areas, in a tree whose far nodes act as one source.

    Parameters
    ----------
    points : (n, 3) float64 or PointTree
    areas : (n,) float64, in the squared unit of the points

    Examples
    --------
    >>> tree = DipoleTree(np.eye(3), np.ones(3))
    >>> tree.outward(np.eye(3), np.full(3, 0.1)).shape
    (3, 3)
    """

    opening = 0.5
    """A node acts as one source where its radius is below this fraction of the distance. On even samplings the gradient
    is then 0.1 to 0.2 degrees off that of the exact sum on average, and the number 0.01."""

    def __init__(self, points: NDArray[np.float64] | PointTree, areas: NDArray[np.float64]) -> None:
        self._tree = points if isinstance(points, PointTree) else PointTree(points)
        self.areas = areas
        weight = areas[self._tree.order][:, None]
        self._centre = self._tree.sums(weight * self._tree.points) / self._tree.sums(weight)
        self._radius = self._tree.radii(self._centre)

    def outward(
        self, normals: NDArray[np.float64], eps: NDArray[np.float64], opening: float | None = None
    ) -> NDArray[np.float64]:
        """Steepest descent -grad w of the winding number at each point, of the dipoles of all the others.

        A point's own dipole is left out: it would vote for the normal that the point has.

        Parameters
        ----------
        normals : (n, 3) float64
        eps : (n,) float64
            Width of the kernel at each point; 0 where no value is wanted: the result is 0 there.
        opening : float, in [0, 1), optional
            Groups of points act as one where their radius is below this fraction of their distance; 0 is exact.

        Returns
        -------
        (n, 3) float64
            Times 4 pi.
        """
        return self._evaluate(normals, eps, opening)[:, : normals.shape[1]]

    def outward_and_number(
        self, normals: NDArray[np.float64], eps: NDArray[np.float64], opening: float | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """`outward` (n, 3) and `number` (n,) at the points, which cost no more together than one alone."""
        columns = self._evaluate(normals, eps, opening)
        return columns[:, : normals.shape[1]], columns[:, 3] / (4.0 * np.pi)

    def number(
        self,
        normals: NDArray[np.float64],
        eps: NDArray[np.float64],
        positions: NDArray[np.float64] | None = None,
        opening: float | None = None,
    ) -> NDArray[np.float64]:
        """Winding number: about 1/2 at a point of the surface, 1 inside it and 0 outside.

        Parameters
        ----------
        normals : (n, 3) float64
        eps : (k,) float64
            Width of the kernel at each position; 0 where no value is wanted: the result is 0 there.
        positions : (k, 3) float64, optional
            By default the points themselves, each without its own dipole.
        opening : float, in [0, 1), optional
            As in `outward`.

        Returns
        -------
        (k,) float64
        """
        return self._evaluate(normals, eps, opening, positions)[:, 3] / (4.0 * np.pi)

    def _evaluate(
        self,
        normals: NDArray[np.float64],
        eps: NDArray[np.float64],
        opening: float | None,
        positions: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Columns of -4 pi grad w, and 4 pi w."""
        dipoles = (normals * self.areas[:, None])[self._tree.order]
        queries = self._tree if positions is None else PointTree(positions)
        opening = self.opening if opening is None else opening
        found = np.zeros((len(queries.points), 4))
        self._add_sums(queries, positions is None, dipoles, eps[queries.order], self._moments(dipoles), opening, found)
        out = np.empty_like(found)
        out[queries.order] = found
        return out

    def _moments(self, dipoles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sum up the dipoles (n, 3) of each node and the symmetric part of sum_j m_j (p_j - c)^T: (m, 9).

        Of this xx, yy, zz, xy, xz, yz, the last three twice.
        """
        first, second = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)

        def products(m: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
            both = m[:, first] * p[:, second]
            both[:, 3:] += m[:, second[3:]] * p[:, first[3:]]
            return both

        middle = self._centre[0]
        sums = self._tree.sums(np.concatenate([dipoles, products(dipoles, self._tree.points - middle)], axis=1))
        sums[:, 3:] -= products(sums[:, :3], self._centre - middle)
        return sums

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

        def run(groups: slice) -> None:
            _dipole_sums(
                groups.start, groups.stop, queries.groups, queries.points, themselves, tree.points, dipoles, eps,
                tree.start, tree.stop, tree.child, self._centre, self._radius, moments, opening,
                np.empty(STACK, dtype=np.int64), np.empty((12, LIST), dtype=np.float32), out,
            )  # fmt: skip

        in_threads(run, len(queries.groups) - 1, 32)


@compiled(nogil=True, fastmath=True, error_model="numpy")
def _dipole_sums(  # type: ignore[no-untyped-def]
    first, last, groups, queries, themselves, points, dipoles, eps, start, stop, child, centre, radius, moments,
    opening, stack, source, out,
):  # fmt: skip
    """Sum what all points cause, for groups of queries: they share one walk down the tree.

    -4 pi grad w = sum_j m_j / r^3 - 3 (m_j . d) d / r^5 and 4 pi w = sum_j m_j . d / r^3, with d = p_j - x,
    r^2 = |d|^2 + eps^2 and m_j = a_j n_j. Of a far node with its centre at c and d = c - x, the sum m of its dipoles
    counts and the symmetric part S of sum_j m_j (p_j - c)^T: both sides of a thin wall in one node cancel in the first
    alone. 4 pi w = (m . d + tr S) / r^3 - 3 d . S d / r^5, and the other is its gradient in d.

    A node is far where it is from every query of the group. Queries that are the points themselves leave themselves
    out. Sources are collected, and added a list at a time: columns of positions and dipoles, so that it vectorises.
    They are single precision, of which sums keep six digits: twice as many fit into a register, and roots and quotients
    take a fourth of the time. Lengths are in the widths of the group's kernels, from its middle, so that neither
    distance nor scale takes digits away.
    """
    half, one, three = np.float32(0.5), np.float32(1.0), np.float32(3.0)
    five, six = np.float32(5.0), np.float32(6.0)
    for group in range(first, last):
        begin, end = groups[group], groups[group + 1]
        x, y, z, width = 0.0, 0.0, 0.0, 0.0
        wanted = 0
        for i in range(begin, end):
            if eps[i] != 0.0:
                x, y, z = x + queries[i, 0], y + queries[i, 1], z + queries[i, 2]
                width += eps[i]
                wanted += 1
        if wanted == 0:
            continue
        x, y, z, unit = x / wanted, y / wanted, z / wanted, wanted / width
        reach = 0.0
        for i in range(begin, end):
            if eps[i] != 0.0:
                dx, dy, dz = queries[i, 0] - x, queries[i, 1] - y, queries[i, 2] - z
                squared = dx * dx + dy * dy + dz * dz
                if squared > reach:
                    reach = squared
        reach = opening * math.sqrt(reach)
        stack[0] = 0
        top = 1
        # The rest of the leaf at hand.
        at, upto = 0, 0
        walking = True
        # The group's own points come first: each must leave out itself.
        own = end - begin if themselves else 0
        for k in range(own):
            source[0, k] = (points[begin + k, 0] - x) * unit
            source[1, k] = (points[begin + k, 1] - y) * unit
            source[2, k] = (points[begin + k, 2] - z) * unit
            for d in range(9):
                source[3 + d, k] = dipoles[begin + k, d] * unit * unit if d < 3 else 0.0
        while walking:
            count = own
            while count < LIST:
                if at < upto:
                    k = at
                    at += 1
                    if themselves and begin <= k < end:
                        continue
                    px, py, pz = points[k, 0], points[k, 1], points[k, 2]
                    for d in range(9):
                        source[3 + d, count] = dipoles[k, d] * unit * unit if d < 3 else 0.0
                elif top > 0:
                    top -= 1
                    node = stack[top]
                    px, py, pz = centre[node, 0], centre[node, 1], centre[node, 2]
                    dx, dy, dz = px - x, py - y, pz - z
                    least = radius[node] + reach
                    if least * least >= opening * opening * (dx * dx + dy * dy + dz * dz):
                        if child[node] >= 0:
                            stack[top] = child[node]
                            stack[top + 1] = child[node] + 1
                            top += 2
                        else:
                            at, upto = start[node], stop[node]
                        continue
                    for d in range(9):
                        moment = moments[node, d] * unit * unit * (1.0 if d < 3 else unit)
                        source[3 + d, count] = min(max(moment, -LARGEST), LARGEST)
                else:
                    walking = False
                    break
                source[0, count], source[1, count], source[2, count] = (px - x) * unit, (py - y) * unit, (pz - z) * unit
                count += 1
            for i in range(begin, end):
                if eps[i] == 0.0:
                    continue
                x0 = np.float32((queries[i, 0] - x) * unit)
                y0 = np.float32((queries[i, 1] - y) * unit)
                z0 = np.float32((queries[i, 2] - z) * unit)
                squared = np.float32((eps[i] * unit) ** 2)
                itself = i - begin
                if own > 0:
                    for d in range(3, 6):
                        source[d, itself] = 0.0
                gx, gy, gz, w = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
                for j in range(count):
                    dx, dy, dz = source[0, j] - x0, source[1, j] - y0, source[2, j] - z0
                    # By 1 / r and e = d / r: powers of r itself leave single precision.
                    near = one / math.sqrt(dx * dx + dy * dy + dz * dz + squared)
                    dx, dy, dz, inverse = dx * near, dy * near, dz * near, near * near
                    # The last three of S count twice already.
                    xy, xz, yz = half * source[9, j], half * source[10, j], half * source[11, j]
                    sx = source[6, j] * dx + xy * dy + xz * dz
                    sy = xy * dx + source[7, j] * dy + yz * dz
                    sz = xz * dx + yz * dy + source[8, j] * dz
                    bent = three * (dx * sx + dy * sy + dz * sz)
                    trace = source[6, j] + source[7, j] + source[8, j]
                    along = dx * source[3, j] + dy * source[4, j] + dz * source[5, j]
                    w += inverse * (along + near * (trace - bent))
                    cube, fourth = near * inverse, near * (near * inverse)
                    along = fourth * (five * bent - three * trace) - three * cube * along
                    gx += cube * source[3, j] + along * dx - six * (fourth * sx)
                    gy += cube * source[4, j] + along * dy - six * (fourth * sy)
                    gz += cube * source[5, j] + along * dz - six * (fourth * sz)
                if own > 0:
                    for d in range(3):
                        source[3 + d, itself] = dipoles[i, d] * unit * unit
                out[i, 0] += gx * unit
                out[i, 1] += gy * unit
                out[i, 2] += gz * unit
                out[i, 3] += w
            own = 0
