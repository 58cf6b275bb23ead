"""The isosurface of a field given at the vertices of a tetrahedral mesh, by marching tetrahedra.

FaCE calls a point interior where the isosurface of the field strength encloses it (paper section 3.4):
`fill_balls` closes the holes that the cage leaves in the mesh, `isosurface` extracts the surface.
"""

from __future__ import annotations

from itertools import permutations
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.faraday.inside import inside
from face_plugin.faraday.meshers import CageMesh

__all__ = ["fill_balls", "isosurface", "shielded"]

# Row k: the face opposite to vertex k of a positive tetrahedron, wound so that it faces outwards.
_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])

# How a cell is cut, as pairs of its own vertices: a surface vertex lies on the edge between the two, or at a
# vertex that is paired with itself. First where no vertex is above, then where the first is, then the first
# two, and so on.
_TET_CUTS: list[list[str]] = [[], ["01 03 02"], ["20 21 31", "20 31 30"], ["30 32 31"], []]
_FACE_CUTS: list[list[str]] = [["00 11 22"], ["01 11 22", "01 22 02"], ["22 20 21"], []]


def _table(cuts: list[list[str]]) -> NDArray[np.int64]:
    """Lay out the cuts for `march`: each sign case is one of them up to an even permutation of vertices."""
    size = len(cuts) - 1
    table = np.full((1 << size, 2, 3, 2), -1)
    for order in permutations(range(size)):
        even = np.linalg.det(np.eye(size)[list(order)]) > 0
        for count, cut in enumerate(cuts):
            if even:
                case = sum(1 << vertex for vertex in order[:count])
                for row, triangle in enumerate(cut):
                    ends = [order[int(vertex)] for vertex in triangle.replace(" ", "")]
                    table[case, row] = np.reshape(ends, (3, 2))
    return table


def shielded(
    mesh: CageMesh,
    strength: NDArray[np.float64],
    points: NDArray[np.float64],
    alpha: float,
    method: Literal["rays", "winding"],
) -> NDArray[np.bool_]:
    """Which points (n,) the alpha-isosurface of E_max encloses (paper section 3.5).

    Parameters
    ----------
    mesh : CageMesh
    strength : (m,) float64
        E_max at the vertices of the mesh.
    points : (n, 3) float64
        In the frame of the mesh.
    alpha : float
    method : {"rays", "winding"}
    """
    surface = isosurface(*fill_balls(mesh, strength), alpha)
    return inside(points, *surface, method=method)


def isosurface(
    vertices: ArrayLike, tets: ArrayLike, values: ArrayLike, level: float, *, close: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Extract the surface on which a piecewise linear field equals `level`.

    The surface bounds the region where the field is below `level`; a value equal to `level` counts as above
    (a symbolic perturbation, the same for every tetrahedron). With `close`, and on a mesh whose boundary is a
    manifold, every edge of the surface joins exactly two triangles, which run along it in opposite
    directions, whatever the values are. This is why triangles of zero area are kept: where a vertex has the
    value `level` itself, each edge that goes down from it ends in a surface vertex of its own, all at the
    same place.

    Parameters
    ----------
    vertices : (m, 3) array_like of float
        Vertices of the mesh, in any unit of length.
    tets : (t, 4) array_like of int
        Conforming, positively oriented tetrahedra: ``det([b - a, c - a, d - a]) > 0`` for each (a, b, c, d).
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
        Triangles of the surface. Their normals, by the right-hand rule, point towards growing values, out of
        the region below `level`. Both arrays are empty where there is no such region.

    Raises
    ------
    ValueError
        If an argument has the wrong shape or is not finite, or a tetrahedron names a vertex that does not
        exist.

    Notes
    -----
    Paper section 3.4: marching tetrahedra on the mesh with its balls filled. The time grows linearly with the
    size of the mesh.

    Examples
    --------
    >>> import numpy as np
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> v, f = isosurface(corners, [[0, 1, 2, 3]], [0.0, 1, 1, 1], 0.5, close=False)
    >>> len(f), np.cross(v[f[0, 1]] - v[f[0, 0]], v[f[0, 2]] - v[f[0, 0]])
    (1, array([0.25, 0.25, 0.25]))
    """
    from face_plugin.faraday.marching import boundary_candidates, march, number_edges

    points = np.ascontiguousarray(vertices, dtype=np.float64)
    cells = np.ascontiguousarray(tets)
    field = np.ascontiguousarray(values, dtype=np.float64)
    _check(points, cells, field, level)
    above = field >= level
    if cells.dtype != np.int32:
        cells = cells.astype(np.int64)  # so that no more than two versions are compiled
    ends = march(cells, above, _table(_TET_CUTS))
    if close:
        salt = np.random.default_rng(0).integers(1 << 62, size=len(points), dtype=np.uint64) * np.uint64(2)
        faces = boundary_candidates(cells, above, _FACES, salt + np.uint64(1))
        ends = np.concatenate([ends, march(_unpaired(faces).astype(cells.dtype), above, _table(_FACE_CUTS))])
    number, distinct = number_edges(ends.reshape(-1, 2), len(points))
    a, b = distinct.T
    t = np.where(a == b, 0.0, level - field[a]) / np.where(a == b, 1.0, field[b] - field[a])
    return points[a] + t[:, None] * (points[b] - points[a]), number.reshape(-1, 3)


def fill_balls(mesh: CageMesh, values: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Fill the balls of a mesh, so that it covers the whole box.

    Each ball gets a vertex at the mean of its cage vertices, with the mean of their values, and one
    tetrahedron for each of its facets. A facet is a face with three vertices of one ball and a tetrahedron on
    one side only.

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
    Paper section 3.4: the isosurface needs a field inside the balls too, where the method does not solve for
    one. On a mesh filled in this way the centre of a ball is a vertex, so that an isosurface encloses it
    exactly where the value there is below the level: no surface is needed to classify the centres.

    Examples
    --------
    >>> import numpy as np
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    >>> tets, owner = np.array([[1, 2, 3, 4]], np.int32), np.array([0, 0, 0, 0, -1], np.int32)
    >>> mesh = CageMesh(corners, tets, owner, owner < -1, np.zeros(3), np.ones(3))
    >>> vertices, tets, values = fill_balls(mesh, [0.0, 1, 2, 3, 9])
    >>> vertices[5], tets[1].tolist(), values[5].item()
    (array([0.25, 0.25, 0.25]), [5, 1, 2, 3], 1.5)
    """
    field = np.asarray(values, dtype=np.float64)
    if field.shape != (len(mesh.vertices),):
        raise ValueError(f"values: shape ({len(mesh.vertices)},) is needed, one a vertex, got {field.shape}")
    owned = np.flatnonzero(mesh.owner >= 0)
    balls, ball = np.unique(mesh.owner[owned], return_inverse=True)
    count = np.bincount(ball, minlength=len(balls))

    def means(data: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(ball, weights=data[owned], minlength=len(balls)) / count)

    centres = np.stack([means(mesh.vertices[:, k]) for k in range(3)], axis=1)
    owner = [np.ascontiguousarray(column) for column in mesh.owner[mesh.tets].T]
    faces = []
    for i, j, k in _FACES:
        same = np.flatnonzero((owner[i] == owner[j]) & (owner[j] == owner[k]) & (owner[i] >= 0))
        # A face is wound out of its tetrahedron, into the ball; the ball's tetrahedron is on its other side.
        faces.append(mesh.tets[same][:, [i, k, j]])
    facets = _unpaired(np.concatenate(faces))
    apex = len(mesh.vertices) + np.searchsorted(balls, mesh.owner[facets[:, 0]])
    caps = np.column_stack([apex, facets]).astype(np.int32)
    return (
        np.concatenate([mesh.vertices, centres]),
        np.concatenate([mesh.tets.astype(np.int32, copy=False), caps]),
        np.concatenate([field, means(field)]),
    )


def _check(points: NDArray[np.float64], cells: NDArray[Any], field: NDArray[np.float64], level: float) -> None:
    """Raise `ValueError` for what `isosurface` cannot use."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"vertices: an array of shape (m, 3) is needed, got {points.shape}")
    if cells.ndim != 2 or cells.shape[1] != 4 or cells.dtype.kind not in "iu":
        raise ValueError(f"tets: integers of shape (t, 4) are needed, got {cells.dtype} {cells.shape}")
    if field.shape != (len(points),):
        raise ValueError(f"values: shape ({len(points)},) is needed, one a vertex, got {field.shape}")
    if cells.size and (cells.min() < 0 or cells.max() >= len(points)):
        raise ValueError(f"tets: indices from 0 to {len(points) - 1} are allowed, got {cells.min()} to {cells.max()}")
    for name, data in (("vertices", points), ("values", field), ("level", np.asarray(level))):
        if not np.isfinite(data).all():
            raise ValueError(f"{name}: finite numbers are needed, got NaN or infinity")


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
