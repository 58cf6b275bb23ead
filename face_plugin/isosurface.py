"""The isosurface of a field given at the vertices of a tetrahedral mesh, by marching tetrahedra.

FaCE calls a point interior where the isosurface of the field strength encloses it (paper section 3.4): `fill_balls`
closes the holes that the cage leaves in the mesh, `isosurface` extracts the surface.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.meshers import CageMesh

__all__ = ["fill_balls", "isosurface"]

# Row k: the face opposite to vertex k of a positive tetrahedron, wound so that it faces outwards.
_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])

# Row c, bit i of c set where vertex i is above: an even permutation (it keeps the tetrahedron positive) that puts
# the vertex that is alone first, or the two vertices below first.
_ORDER = np.array(
    [
        *([0, 1, 2, 3], [0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1]),
        *([2, 0, 1, 3], [1, 3, 2, 0], [0, 3, 1, 2], [3, 2, 1, 0]),
        *([3, 2, 1, 0], [1, 2, 0, 3], [0, 2, 3, 1], [2, 3, 0, 1]),
        *([0, 1, 2, 3], [1, 0, 3, 2], [0, 1, 2, 3], [0, 1, 2, 3]),
    ]
)


def isosurface(
    vertices: ArrayLike, tets: ArrayLike, values: ArrayLike, level: float, *, close: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Extract the surface on which a piecewise linear field equals `level`.

    The surface bounds the region where the field is below `level`; a value equal to `level` counts as above
    (a symbolic perturbation, the same for every tetrahedron). With `close`, every edge of the surface joins exactly two
    triangles, which run along it in opposite directions, whatever the values are. This is why triangles of
    zero area are kept: where a vertex has the value `level` itself, each edge that goes down from it ends in a
    surface vertex of its own, all at the same place.

    Parameters
    ----------
    vertices : (m, 3) array_like of float
        Vertices of the mesh, in any unit of length.
    tets : (t, 4) array_like of int
        Conforming, positively oriented tetrahedra: ``det([b - a, c - a, d - a]) > 0`` for a row ``a, b, c, d``.
    values : (m,) array_like of float
        Field at the vertices.
    level : float
        Value of the field on the surface, in the unit of `values`.
    close : bool, default: True
        Whether the surface runs on along the boundary of the mesh where the field is below `level` there. The
        surface is open where it meets the boundary otherwise.

    Returns
    -------
    v : (k, 3) ndarray of float64
        Vertices of the surface, in the unit of `vertices`; every one is used.
    f : (q, 3) ndarray of int64
        Triangles of the surface. Their normals, by the right-hand rule, point towards growing values, out of the
        region below `level`. Both arrays are empty where there is no such region.

    Raises
    ------
    ValueError
        If an argument has the wrong shape or is not finite, or a tetrahedron names a vertex that does not exist.

    Notes
    -----
    The paper's section 3.4 takes the isosurface from marching tetrahedra on the mesh with its balls filled. Only
    the tetrahedra that the surface crosses are looked at closely, so the time goes with the size of the surface.

    Examples
    --------
    >>> import numpy as np
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> v, f = isosurface(corners, [[0, 1, 2, 3]], [0.0, 1, 1, 1], 0.5, close=False)
    >>> len(f), np.cross(v[f[0, 1]] - v[f[0, 0]], v[f[0, 2]] - v[f[0, 0]])
    (1, array([0.25, 0.25, 0.25]))
    """
    points = np.ascontiguousarray(vertices, dtype=np.float64)
    cells = np.ascontiguousarray(tets)
    field = np.ascontiguousarray(values, dtype=np.float64)
    _check(points, cells, field, level)
    above = field >= level
    case = _cases(cells, above)
    cut = np.flatnonzero((case > 0) & (case < 15))
    pieces = [_cross(cells[cut].astype(np.int64), case[cut])]
    if close and (case < 15).any():
        faces = _candidates()(cells[case < 15], above, _FACES, _salt(len(points)))
        pieces.append(_cap(_unpaired(faces), above))
    return _number(np.concatenate(pieces), points, field, level)


def fill_balls(
    mesh: CageMesh, values: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Fill the balls of a mesh, so that it covers the whole box.

    Each ball gets a vertex at the mean of its cage vertices, with the mean of their values, and one tetrahedron
    for each of its facets. A facet is a face with three vertices of one ball and a tetrahedron on one side only.

    Parameters
    ----------
    mesh : CageMesh
        Mesh of the box minus the balls.
    values : (m,) array_like of float
        Field at the vertices of the mesh.

    Returns
    -------
    vertices : (m + b, 3) ndarray of float64
        Vertices of the mesh, then the centres of its b balls in growing order of their index.
    tets : (t + s, 4) ndarray of int32
        Tetrahedra of the mesh, then those of the balls, all positively oriented.
    values : (m + b,) ndarray of float64
        Field at `vertices`.

    Raises
    ------
    ValueError
        If there is not one value a vertex.

    Notes
    -----
    Paper section 3.4: the isosurface needs a field inside the balls too, where the method does not solve for one.

    Examples
    --------
    >>> import numpy as np
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    >>> mesh = CageMesh(corners, np.array([[1, 2, 3, 4]], dtype=np.int32), np.array([0, 0, 0, 0, -1], dtype=np.int32),
    ...                 np.zeros(5, dtype=bool), np.zeros(3), np.ones(3))
    >>> vertices, tets, values = fill_balls(mesh, [0.0, 1, 2, 3, 9])
    >>> vertices[5], tets[1], values[5]
    (array([0.25, 0.25, 0.25]), array([5, 1, 2, 3], dtype=int32), np.float64(1.5))
    """
    field = np.asarray(values, dtype=np.float64)
    if field.shape != (len(mesh.vertices),):
        raise ValueError(f"values: one for each of the {len(mesh.vertices)} vertices is needed, got shape {field.shape}")
    owned = np.flatnonzero(mesh.owner >= 0)
    balls, ball = np.unique(mesh.owner[owned], return_inverse=True)
    count = np.bincount(ball, minlength=len(balls))

    def means(data: NDArray[np.float64]) -> NDArray[np.float64]:
        sums: NDArray[np.float64] = np.bincount(ball, weights=data[owned], minlength=len(balls))
        return sums / count

    centres = np.stack([means(mesh.vertices[:, k]) for k in range(3)], axis=1)
    owner = [np.ascontiguousarray(column) for column in mesh.owner[mesh.tets].T]
    faces = []
    for a, b, c in _FACES:
        same = np.flatnonzero((owner[a] == owner[b]) & (owner[b] == owner[c]) & (owner[a] >= 0))
        # A face is wound out of its tetrahedron, into the ball; the ball's tetrahedron lies on its other side.
        faces.append(mesh.tets[same][:, [a, c, b]])
    facets = _unpaired(np.concatenate(faces))
    apex = len(mesh.vertices) + np.searchsorted(balls, mesh.owner[facets[:, 0]])
    caps = np.column_stack([apex, facets]).astype(np.int32)
    return (
        np.concatenate([mesh.vertices, centres]),
        np.concatenate([mesh.tets.astype(np.int32, copy=False), caps]),
        np.concatenate([field, means(field)]),
    )


def _check(
    points: NDArray[np.float64], cells: NDArray[Any], field: NDArray[np.float64], level: float
) -> None:
    """Raise `ValueError` for what `isosurface` cannot use."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"vertices: an array of shape (m, 3) is needed, got {points.shape}")
    if cells.ndim != 2 or cells.shape[1] != 4 or cells.dtype.kind not in "iu":
        raise ValueError(f"tets: integers of shape (t, 4) are needed, got {cells.dtype} of shape {cells.shape}")
    if field.shape != (len(points),):
        raise ValueError(f"values: one for each of the {len(points)} vertices is needed, got shape {field.shape}")
    if cells.size and (cells.min() < 0 or cells.max() >= len(points)):
        raise ValueError(
            f"tets: indices from 0 to {len(points) - 1} are allowed, got {cells.min()} to {cells.max()}"
        )
    for name, data in (("vertices", points), ("values", field), ("level", np.asarray(level))):
        if not np.isfinite(data).all():
            raise ValueError(f"{name}: finite numbers are needed, got NaN or infinity")


def _cases(cells: NDArray[Any], above: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Give the sign case of each tetrahedron: bit i is set where its vertex i is above."""
    bits = above.view(np.uint8)
    case: NDArray[np.uint8] = bits[cells[:, 0]]
    for i in range(1, 4):
        case |= bits[cells[:, i]] << np.uint8(i)
    return case


def _cross(cells: NDArray[np.int64], case: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Triangulate what the surface cuts out of each tetrahedron, as (q, 3, 2) mesh edges."""
    i, j, k, m = np.take_along_axis(cells, _ORDER[case], axis=1).T
    ones = np.array([bin(c).count("1") for c in range(16)])[case]

    def triangle(chosen: NDArray[np.bool_], *ends: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.stack([end[chosen] for end in ends], axis=1).reshape(-1, 3, 2)

    one, two, three = ones == 1, ones == 2, ones == 3
    return np.concatenate(
        [
            triangle(three, i, j, i, k, i, m),  # i alone is below
            triangle(one, i, j, i, m, i, k),  # i alone is above
            triangle(two, i, k, i, m, j, m),
            triangle(two, i, k, j, m, j, k),
        ]
    )


def _cap(faces: NDArray[np.int64], above: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Triangulate the part of each face that is below, as (q, 3, 2) mesh edges; a vertex is an edge to itself."""
    is_above = above[faces]
    ones = is_above.sum(axis=1)
    # Turn each face so that the vertex that differs from the other two comes first.
    first = np.where(ones == 1, is_above.argmax(axis=1), is_above.argmin(axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turn, axis=1).T

    def triangle(count: int, *ends: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.stack([end[ones == count] for end in ends], axis=1).reshape(-1, 3, 2)

    return np.concatenate(
        [
            triangle(0, a, a, b, b, c, c),
            triangle(1, a, b, b, b, c, c),
            triangle(1, a, b, c, c, a, c),
            triangle(2, a, a, a, b, a, c),
        ]
    )


def _number(
    ends: NDArray[np.int64], points: NDArray[np.float64], field: NDArray[np.float64], level: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Turn triangles between mesh edges into a surface with one vertex an edge."""
    low, high = ends.min(axis=2).ravel(), ends.max(axis=2).ravel()
    keys, index = np.unique(low * len(points) + high, return_inverse=True)
    a, b = np.divmod(keys, max(len(points), 1))
    rise = np.where(a == b, 1.0, field[b] - field[a])
    t = np.where(a == b, 0.0, level - field[a]) / rise
    surface = points[a] + t[:, None] * (points[b] - points[a])
    return surface, index.reshape(-1, 3).astype(np.int64, copy=False)


def _unpaired(faces: NDArray[Any]) -> NDArray[np.int64]:
    """Keep the faces that occur once, whatever the order of their vertices."""
    ordered = np.sort(faces.astype(np.int64), axis=1)
    order = np.lexsort((ordered[:, 2], ordered[:, 1], ordered[:, 0]))
    same = (ordered[order[1:]] == ordered[order[:-1]]).all(axis=1)
    alone = np.ones(len(faces), dtype=bool)
    alone[1:] &= ~same
    alone[:-1] &= ~same
    kept: NDArray[np.int64] = faces[order[alone]].astype(np.int64)
    return kept


def _salt(count: int) -> NDArray[np.uint64]:
    """Give each vertex an odd random number, so that products of them tell faces apart."""
    return np.random.default_rng(0).integers(1 << 63, size=count, dtype=np.uint64) * np.uint64(2) + np.uint64(1)


@lru_cache(maxsize=1)
def _candidates() -> Callable[..., NDArray[np.int64]]:
    """Compile the search for faces with a vertex below that may lie on the boundary of the mesh.

    Sorting all faces of a large mesh takes longer than everything else. Instead each face leaves a hash at its three
    vertices by exclusive or, so that the two sides of an inner face cancel; a vertex where something is left
    is on the boundary. Few faces have three of those, and only they are compared exactly afterwards.
    """
    from numba import njit

    @njit(cache=True)
    def candidates(cells, above, faces, salt):  # type: ignore[no-untyped-def]
        residue = np.zeros(len(above), dtype=np.uint64)
        for cell in cells:
            for i, j, k in faces:
                a, b, c = cell[i], cell[j], cell[k]
                if not (above[a] and above[b] and above[c]):
                    code = salt[a] * salt[b] * salt[c]
                    residue[a] ^= code
                    residue[b] ^= code
                    residue[c] ^= code
        found = [(0, 0, 0) for _ in range(0)]
        for cell in cells:
            for i, j, k in faces:
                a, b, c = cell[i], cell[j], cell[k]
                if residue[a] and residue[b] and residue[c] and not (above[a] and above[b] and above[c]):
                    found.append((int(a), int(b), int(c)))
        out = np.empty((len(found), 3), dtype=np.int64)
        for row in range(len(found)):
            out[row, 0], out[row, 1], out[row, 2] = found[row]
        return out

    return candidates  # type: ignore[no-any-return]
