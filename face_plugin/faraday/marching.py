"""Compiled loops of `face_plugin.faraday.isosurface`, apart so that importing that module does not load numba."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled

__all__ = ["boundary_candidates", "march", "number_edges"]


def march(cells: NDArray[Any], above: NDArray[np.bool_], table: NDArray[np.int64]) -> NDArray[np.int64]:
    """Look up the triangles that each cell holds, as (q, 3, 2) pairs of vertices, the smaller first.

    Row c of the table holds the triangles, in pairs of the cell's own vertices, for the cells whose vertex i
    is above where bit i of c is set; -1 stands for no triangle. Cells are tetrahedra or triangles.
    """
    ends = np.empty((0, 3, 2), dtype=np.int64)
    ends = np.empty((_march(cells, above, table, ends), 3, 2), dtype=np.int64)
    _march(cells, above, table, ends)
    return ends


@compiled()
def _march(cells, above, table, ends):  # type: ignore[no-untyped-def]
    """Count the triangles, and fill them in where there is room."""
    row = 0
    for t in range(len(cells)):
        case = 0
        for i in range(cells.shape[1]):
            if above[cells[t, i]]:
                case |= 1 << i
        for cut in range(table.shape[1]):
            if table[case, cut, 0, 0] >= 0:
                if row < len(ends):
                    for corner in range(3):
                        a = cells[t, table[case, cut, corner, 0]]
                        b = cells[t, table[case, cut, corner, 1]]
                        ends[row, corner, 0] = a if a < b else b
                        ends[row, corner, 1] = b if a < b else a
                row += 1
    return row


def number_edges(ends: NDArray[np.int64], vertices: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give the distinct rows of (r, 2) numbers in the order of their first occurrence.

    Returns the number of each row and the (k, 2) distinct rows. A vertex of the mesh has a handful of edges,
    so a list of those seen so far at their smaller vertex is searched faster than all rows are sorted.
    """
    following, number = np.empty((2, len(ends)), dtype=np.int64)
    distinct = np.empty((len(ends), 2), dtype=np.int64)
    count = _number_edges(ends, np.full(vertices, -1), following, distinct, number)
    return number, distinct[:count].copy()


@compiled()
def _number_edges(ends, head, following, distinct, number):  # type: ignore[no-untyped-def]
    count = 0
    for row in range(len(ends)):
        a, b = ends[row, 0], ends[row, 1]
        k = head[a]
        while k >= 0 and distinct[k, 1] != b:
            k = following[k]
        if k < 0:
            k = count
            count += 1
            distinct[k, 0] = a
            distinct[k, 1] = b
            following[k] = head[a]
            head[a] = k
        number[row] = k
    return count


def boundary_candidates(
    tets: NDArray[Any], above: NDArray[np.bool_], faces: NDArray[np.int64], salt: NDArray[np.uint64]
) -> NDArray[Any]:
    """Select the faces, not wholly above, that may be in one tetrahedron only: all that are, and few others.

    Sorting the faces of a large mesh takes longer than everything else. Instead each face leaves a hash at
    its three vertices by exclusive or, so that the two sides of an inner face cancel; a vertex where
    something is left is on the boundary (that nothing is left there by accident has a chance of 2^-60). A
    candidate has three of those.
    """
    residue = np.zeros(len(above), dtype=np.uint64)
    _leave_hashes(tets, above, faces, salt, residue)
    left = residue != 0
    found = np.empty((0, 3), dtype=tets.dtype)
    found = np.empty((_faces_between(tets, above, faces, left, found), 3), dtype=tets.dtype)
    _faces_between(tets, above, faces, left, found)
    return found


@compiled()
def _leave_hashes(tets, above, faces, salt, residue):  # type: ignore[no-untyped-def]
    for t in range(len(tets)):
        for side in range(4):
            a, b, c = tets[t, faces[side, 0]], tets[t, faces[side, 1]], tets[t, faces[side, 2]]
            if not (above[a] and above[b] and above[c]):
                code = salt[a] * salt[b] * salt[c]
                residue[a] ^= code
                residue[b] ^= code
                residue[c] ^= code


@compiled()
def _faces_between(tets, above, faces, left, found):  # type: ignore[no-untyped-def]
    """Count the faces of vertices where something is left, and fill them in where there is room."""
    row = 0
    for t in range(len(tets)):
        for side in range(4):
            a, b, c = tets[t, faces[side, 0]], tets[t, faces[side, 1]], tets[t, faces[side, 2]]
            if left[a] and left[b] and left[c] and not (above[a] and above[b] and above[c]):
                if row < len(found):
                    found[row, 0] = a
                    found[row, 1] = b
                    found[row, 2] = c
                row += 1
    return row
