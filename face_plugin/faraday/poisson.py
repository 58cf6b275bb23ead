"""The Poisson problem of the cage: linear finite elements, the conductor eliminated, one factorisation.

On tetrahedra of the box minus the balls, ``L u = 0`` with the cotangent Laplacian L, u given on the box, and
one unknown value u_C on all balls together, whose net charge is zero (paper equation 4). With f the free
vertices, b those of the box, c those of the balls and 1 the vector of ones, the potential is

    u_f = A^-1 (-L_fb g_b) + u_C A^-1 (-L_fc 1),   A = L_ff,

a solution for the boundary data g with the cage at 0, plus u_C times the one with the cage at 1 and the box
at 0. Only A is factorised: it is sparse, symmetric and positive definite, where carrying u_C would add a
dense row. The flux out of the cage is linear in u_C; setting it to zero gives u_C.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from threadpoolctl import ThreadpoolController

from face_plugin.compiled import compiled
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.triangles import triangle_stiffness

__all__ = ["Poisson", "stiffness"]

log = logging.getLogger(__name__)

Solve = Callable[[NDArray[np.float64]], NDArray[np.float64]]
SolverName = Literal["auto", "cholmod", "superlu"]


class Poisson:
    """The factorised problem: any number of scenarios can be solved with it.

    Parameters
    ----------
    mesh : CageMesh
    solver : {"auto", "cholmod", "superlu"}
        "auto" takes scikit-sparse's CHOLMOD where it is installed, else SciPy's SuperLU.

    Examples
    --------
    >>> from face_plugin.solver import FaCE
    >>> from face_plugin.shapes import sphere
    >>> face = FaCE(sphere(200).points)
    >>> u = face.poisson.solve(face.mesh.vertices[face.mesh.boundary])
    >>> u.shape == face.mesh.vertices.shape
    True
    """

    def __init__(self, mesh: CageMesh, solver: SolverName = "auto") -> None:
        self.mesh = mesh
        self._column = columns(mesh)
        self.free = np.flatnonzero(self._column >= 0)
        rows = stiffness(mesh.vertices, mesh.tets, self._column)
        count = len(self.free)
        self.matrix: sparse.csc_matrix = rows[:, :count].tocsc()
        self._to_box: sparse.csr_matrix = rows[:, count:-1]
        self._to_cage = rows[:, -1].toarray().ravel()
        self.solve_free = factorise(self.matrix, solver)
        self._cage_at_one = self.solve_free(-self._to_cage)

    def solve(
        self, box_values: NDArray[np.float64], cage_value: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Potential of scenarios given by their values on the box.

        Parameters
        ----------
        box_values : (q, s) float64
            Dirichlet values on the boundary vertices (in the order of the mesh), a column a scenario.
        cage_value : (s,) float64, optional
            Potential of the cage in each scenario; by default it floats at zero net charge.

        Returns
        -------
        (m, s) float64
            Potential at every vertex of the mesh.
        """
        particular = self.solve_free(-(self._to_box @ box_values))
        if cage_value is None:
            cage_value = self._floating_value(box_values, particular)
        u = np.empty((len(self.mesh.vertices), box_values.shape[1]))
        u[self.free] = particular + self._cage_at_one[:, None] * cage_value
        u[self.mesh.boundary] = box_values
        u[self.mesh.owner >= 0] = cage_value
        return u

    def _floating_value(self, box_values: NDArray[np.float64], particular: NDArray[np.float64]) -> NDArray[np.float64]:
        """u_C (s,) at which the net flux out of the cage is zero.

        The balls share no tetrahedron with the box as long as a free vertex lies between; where one does, its
        entry L_cb takes part through the row sums, which are zero: L_cc 1 = -(L_cf 1 + L_cb 1).
        """
        if not (self.mesh.owner >= 0).any():
            return np.zeros(box_values.shape[1])
        to_box = cage_to_box(self.mesh)
        flux_given = self._to_cage @ particular + to_box @ box_values
        flux_per_unit = self._to_cage @ self._cage_at_one - self._to_cage.sum() - to_box.sum()
        return np.asarray(-flux_given / flux_per_unit)


def columns(mesh: CageMesh) -> NDArray[np.int64]:
    """Column of each vertex (m,) in the rows of `stiffness`, by kind.

    Free vertices have 0, 1, ...; those of the box follow as -2 - k, and all cage vertices share -1.
    """
    column = np.full(len(mesh.vertices), -1, dtype=np.int64)
    free = (mesh.owner < 0) & ~mesh.boundary
    column[free] = np.arange(np.count_nonzero(free))
    column[mesh.boundary] = -2 - np.arange(np.count_nonzero(mesh.boundary))
    return column


def stiffness(vertices: NDArray[np.float64], tets: NDArray[np.int32], column: NDArray[np.int64]) -> sparse.csr_matrix:
    """Rows of the cotangent Laplacian L that belong to free vertices.

    The entry of an edge is ``L_ij = sum over tets of volume * grad(phi_i) . grad(phi_j)``; in the plane over triangles.

    Parameters
    ----------
    vertices : (m, d) float64
    tets : (t, d + 1) int32
    column : (m,) int64
        As `columns` gives it.

    Returns
    -------
    (f, f + q + 1) sparse matrix
        Columns: free vertices, vertices of the box, and one for the whole cage.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> L = stiffness(corners, np.array([[0, 1, 2, 3]], dtype=np.int32), np.array([0, -2, -3, -1]))
    >>> L.toarray().round(3)
    array([[ 0.5  , -0.167, -0.167, -0.167]])
    """
    free, box = int(np.count_nonzero(column >= 0)), int(np.count_nonzero(column < -1))
    flat = np.where(column >= 0, column, np.where(column < -1, free - 2 - column, free + box))
    if vertices.shape[1] == 2:
        return triangle_stiffness(vertices, tets, flat, free, free + box + 1)
    row = flat[tets.ravel()]
    start = np.zeros(free + 1, dtype=np.int64)
    np.cumsum(4 * np.bincount(row[row < free], minlength=free), out=start[1:])
    index, value = np.empty(start[-1], dtype=np.int32), np.empty(start[-1])
    _fill_rows(vertices, tets, flat, free, np.empty((4, 3)), start[:-1].copy(), index, value)
    merged = np.zeros_like(start)
    _merge_rows(start, np.full(free + box + 1, -1), index, value, merged)
    count = merged[-1]
    return sparse.csr_matrix((value[:count].copy(), index[:count].copy(), merged), shape=(free, free + box + 1))


@compiled(error_model="numpy")
def _fill_rows(vertices, tets, flat, free, normal, fill, index, value):  # type: ignore[no-untyped-def]
    """Drop the entries of all tetrahedra into the rows of their free vertices, from `fill` (f,) on.

    grad(phi_i) = -n_i / (3 volume), with n_i the area-weighted outward normal of the facet without vertex i; `normal`
    (4, 3) is room for these.
    """
    for t in range(len(tets)):
        p, q, r, s = tets[t, 0], tets[t, 1], tets[t, 2], tets[t, 3]
        if flat[p] >= free and flat[q] >= free and flat[r] >= free and flat[s] >= free:
            continue
        x, y, z = vertices[p, 0], vertices[p, 1], vertices[p, 2]
        ax, ay, az = vertices[q, 0] - x, vertices[q, 1] - y, vertices[q, 2] - z
        bx, by, bz = vertices[r, 0] - x, vertices[r, 1] - y, vertices[r, 2] - z
        cx, cy, cz = vertices[s, 0] - x, vertices[s, 1] - y, vertices[s, 2] - z
        normal[1, 0], normal[1, 1], normal[1, 2] = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        normal[2, 0], normal[2, 1], normal[2, 2] = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        normal[3, 0], normal[3, 1], normal[3, 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        for d in range(3):
            normal[0, d] = -normal[1, d] - normal[2, d] - normal[3, d]
        six = ax * normal[1, 0] + ay * normal[1, 1] + az * normal[1, 2]
        for i in range(4):
            row = flat[tets[t, i]]
            if row < free:
                nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
                place = fill[row]
                fill[row] = place + 4
                for j in range(4):
                    index[place + j] = flat[tets[t, j]]
                    value[place + j] = (nx * normal[j, 0] + ny * normal[j, 1] + nz * normal[j, 2]) / (6.0 * six)


@compiled()
def _merge_rows(start, place, index, value, merged):  # type: ignore[no-untyped-def]
    """Merge the entries of one column along each row, in place; fill in where the rows then start.

    `place` holds the place of each column in the current row, or -1: that merges without sorting.
    """
    out = 0
    for row in range(len(start) - 1):
        begin = out
        for k in range(start[row], start[row + 1]):
            j = index[k]
            if place[j] < begin:
                place[j] = out
                index[out] = j
                value[out] = value[k]
                out += 1
            else:
                value[place[j]] += value[k]
        merged[row + 1] = out


def cage_to_box(mesh: CageMesh) -> NDArray[np.float64]:
    """Row 1^T L_cb (q,): the stiffness between the whole cage and each vertex of the box."""
    touching = (mesh.owner[mesh.tets] >= 0).any(axis=1) & mesh.boundary[mesh.tets].any(axis=1)
    number = np.cumsum(mesh.boundary) - 1
    # The rows of the box's vertices, assembled as if they were free; only their column of the cage is of
    # interest.
    column = np.where(mesh.boundary, number, np.where(mesh.owner >= 0, -1, -2))
    column[column == -2] = -2 - np.arange(np.count_nonzero(column == -2))
    rows = stiffness(mesh.vertices, mesh.tets[touching], column)
    return np.asarray(rows[:, -1].toarray().ravel())


def factorise(matrix: sparse.csc_matrix, solver: SolverName) -> Solve:
    """Factorise a symmetric positive definite matrix; the function returned solves with it.

    Raises
    ------
    MissingDependencyError
        ``solver="cholmod"`` without scikit-sparse.
    """
    if solver != "superlu":
        solve = _cholmod(matrix, required=solver == "cholmod")
        if solve is not None:
            return solve
    from scipy.sparse.linalg import splu

    # Symmetric mode: no pivoting, and an ordering of A + A^T.
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return lambda b: np.asarray(factor.solve(np.ascontiguousarray(b)))


def _cholmod(matrix: sparse.csc_matrix, *, required: bool) -> Solve | None:
    from face_plugin.errors import MissingDependencyError, require

    try:
        cholmod: Any = require("sksparse.cholmod", extra="cholmod")
    except MissingDependencyError:
        if required:
            raise
        log.info("scikit-sparse is not installed: SuperLU is used, about three times slower")
        return None
    # "default" takes AMD where it fills little, and else METIS, where that is installed: at 59,000 unknowns
    # 1.8 s and 7.5 million entries in the factor, with AMD 2.8 s and 11.4 million.
    # One thread: the BLAS beneath sums in another order with more, and tiles must not differ from process to process.
    # To look for the BLAS among all that is loaded takes milliseconds: once, not in every solve of a sculpt.
    one_thread = ThreadpoolController().select(user_api="blas")
    with one_thread.limit(limits=1):
        if hasattr(cholmod, "cho_factor"):
            factor = cholmod.cho_factor(matrix, order="default")
            solve = factor.solve
        else:  # scikit-sparse < 0.5
            solve = cholmod.cholesky(matrix, ordering_method="default")

    def limited(b: NDArray[np.float64]) -> NDArray[np.float64]:
        with one_thread.limit(limits=1):
            return np.asarray(solve(b))

    return limited
