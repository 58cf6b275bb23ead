"""Compiled loops of `face_plugin.faraday.isosurface`, apart so that importing that module does not load numba."""

from __future__ import annotations

import numpy as np

from face_plugin.compiled import compiled

__all__ = ["boundary_candidates", "march", "number_edges"]


@compiled()
def march(cells, above, table):  # type: ignore[no-untyped-def]
    """Look up the triangles that each cell holds, as (q, 3, 2) pairs of vertices, the smaller first.

    Row c of the table holds the triangles, in pairs of the cell's own vertices, for the cells whose vertex i
    is above where bit i of c is set; -1 stands for no triangle. Cells are tetrahedra or triangles.
    """
    room = 0
    for _ in range(2):  # first count, then fill
        ends = np.empty((room, 3, 2), dtype=np.int64)
        row = 0
        for t in range(len(cells)):
            case = 0
            for i in range(cells.shape[1]):
                case |= int(above[cells[t, i]]) << i
            for cut in range(table.shape[1]):
                if table[case, cut, 0, 0] >= 0:
                    if room:
                        for corner in range(3):
                            a = cells[t, table[case, cut, corner, 0]]
                            b = cells[t, table[case, cut, corner, 1]]
                            ends[row, corner, 0] = min(a, b)
                            ends[row, corner, 1] = max(a, b)
                    row += 1
        room = row
    return ends


@compiled()
def number_edges(ends, vertices):  # type: ignore[no-untyped-def]
    """Give the distinct rows of (r, 2) numbers in the order of their first occurrence.

    Returns the number of each row and the (k, 2) distinct rows. A vertex of the mesh has a handful of edges,
    so a list of those seen so far at their smaller vertex is searched faster than all rows are sorted.
    """
    head = np.full(vertices, -1, dtype=np.int64)
    following = np.empty(len(ends), dtype=np.int64)
    distinct = np.empty((len(ends), 2), dtype=np.int64)
    number = np.empty(len(ends), dtype=np.int64)
    count = 0
    for row in range(len(ends)):
        a, b = ends[row]
        k = head[a]
        while k >= 0 and distinct[k, 1] != b:
            k = following[k]
        if k < 0:
            k = count
            count += 1
            distinct[k, 0], distinct[k, 1] = a, b
            following[k] = head[a]
            head[a] = k
        number[row] = k
    return number, distinct[:count].copy()


@compiled()
def boundary_candidates(tets, above, faces, salt):  # type: ignore[no-untyped-def]
    """Select the faces, not wholly above, that may be in one tetrahedron only: all that are, and few others.

    Sorting the faces of a large mesh takes longer than everything else. Instead each face leaves a hash at
    its three vertices by exclusive or, so that the two sides of an inner face cancel; a vertex where
    something is left is on the boundary (that nothing is left there by accident has a chance of 2^-60). A
    candidate has three of those.
    """
    residue = np.zeros(len(above), dtype=np.uint64)
    for t in range(len(tets)):
        if not (above[tets[t, 0]] and above[tets[t, 1]] and above[tets[t, 2]] and above[tets[t, 3]]):
            for side in range(4):
                a, b, c = tets[t, faces[side, 0]], tets[t, faces[side, 1]], tets[t, faces[side, 2]]
                if not (above[a] and above[b] and above[c]):
                    code = salt[a] * salt[b] * salt[c]
                    residue[a] ^= code
                    residue[b] ^= code
                    residue[c] ^= code
    left = residue != 0
    room = 0
    for _ in range(2):  # first count, then fill
        found = np.empty((room, 3), dtype=np.int64)
        row = 0
        for t in range(len(tets)):
            if int(left[tets[t, 0]]) + left[tets[t, 1]] + left[tets[t, 2]] + left[tets[t, 3]] >= 3:
                for side in range(4):
                    a, b, c = tets[t, faces[side, 0]], tets[t, faces[side, 1]], tets[t, faces[side, 2]]
                    if left[a] and left[b] and left[c] and not (above[a] and above[b] and above[c]):
                        if room:
                            found[row, 0], found[row, 1], found[row, 2] = a, b, c
                        row += 1
        room = row
    return found
