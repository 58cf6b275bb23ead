"""Cutting a reconstructed surface where it leaves the points: over an open scan a reconstruction makes a dome."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from face_plugin.geometry import local_spacing
from face_plugin.threads import KDTree

__all__ = [
    "AUTO_DISTANCE",
    "Arrays",
    "TrimDistance",
    "check_distance",
    "trimmed",
    "trimmed_by_density",
    "trimmed_by_distance",
    "where_to_cut",
]

TrimDistance = float | Literal["auto"] | None

AUTO_DISTANCE = 2.0
"""Spacings from the nearest point at which "auto" cuts. Points at random leave gaps: among 10,000 of them a circle of
this radius fits into 0 to 2, one of half the radius into 3,000. The border of the surface is made of arcs of this
radius around the last points: at two spacings these are a sixteenth of a spacing deep."""

# A cut nearer to a vertex than this share of the edge would leave triangles without area.
NEAREST_CUT = 0.01
# A piece with fewer points about it is no surface: as many as a spacing is measured from.
FEWEST_ABOUT = 6
# Points whose spacings count together.
AROUND = 24

Arrays = tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64] | None]


def check_distance(distance: TrimDistance) -> None:
    """Raise a `ValueError` unless it is a positive number, "auto" or None."""
    if distance is None or (isinstance(distance, str) and distance == "auto"):
        return
    number = isinstance(distance, (int, float, np.number)) and not isinstance(distance, bool)
    if not number or not 0.0 < float(distance) < np.inf:
        raise ValueError(f"trim_distance must be a finite number > 0, 'auto' or None, found {distance!r}")


def where_to_cut(count: int, distance: TrimDistance, open_at: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    """Around which of so many points (n,) a surface is cut: with "auto", around those that are open.

    Examples
    --------
    >>> where_to_cut(2, "auto", np.array([True, False])), where_to_cut(2, 1.5, None)
    (array([ True, False]), array([ True,  True]))
    """
    if distance != "auto" or open_at is None:
        return np.full(count, distance not in ("auto", None))
    if np.shape(open_at) != (count,):
        raise ValueError(f"open_at must be as many as points, found {np.shape(open_at)} for {count}")
    return np.asarray(open_at, dtype=np.bool_)


def trimmed(
    mesh: Arrays,
    points: NDArray[np.float64],
    share: float,
    distance: TrimDistance,
    where: NDArray[np.bool_],
    cell: float,
) -> Arrays:
    """Trim by density, if `share` is not 0, and by distance from the points, if any are of `where`."""
    if share > 0:
        mesh = trimmed_by_density(mesh, share)
    if where.any() and len(mesh[1]):
        mesh = trimmed_by_distance(mesh, points, distance, least=cell, where=where)
    return mesh


def trimmed_by_density(mesh: Arrays, share: float) -> Arrays:
    """Drop the vertices of a mesh whose density is in the lowest `share`, and the faces at them.

    Parameters
    ----------
    mesh : (vertices, faces, densities)
        As `face_plugin.surface.poisson_reconstruction` has it; without densities it is returned as it is.
    share : float, in [0, 1)

    Examples
    --------
    >>> corners, faces = np.eye(4)[:, :3], np.array([[0, 1, 2], [1, 2, 3]])
    >>> trimmed_by_density((corners, faces, np.array([0.0, 1.0, 1.0, 1.0])), 0.25)[1]
    array([[0, 1, 2]])
    """
    vertices, faces, densities = mesh
    if densities is None or len(densities) == 0:
        return mesh
    keep = densities >= np.quantile(densities, share)
    return _compact(vertices, faces[keep[faces].all(axis=1)], densities)


def trimmed_by_distance(
    mesh: Arrays,
    points: NDArray[np.float64],
    distance: TrimDistance,
    *,
    least: float = 0.0,
    where: NDArray[np.bool_] | None = None,
) -> Arrays:
    """Cut a mesh where it is farther from the points than so many spacings of the nearest one.

    Triangles that the limit crosses are cut along it, by linear interpolation along their edges; the triangles on both
    sides of an edge share the vertex there. Pieces with hardly a point about them go as well.

    Parameters
    ----------
    mesh : (vertices, faces, densities)
    points : (n, 3) float64
    distance : float > 0 or "auto"
        In spacings: mean distances of a point to its 6 nearest others. "auto": `AUTO_DISTANCE`.
    least : float
        Spacing that is counted at least, in the unit of the points: that of the mesh, where it is coarser.
    where : (n,) bool, optional
        Points around which to cut; the mesh stays whole where the nearest point is another. By default all.

    Examples
    --------
    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(5.0), np.arange(5.0)))
    >>> points = np.stack([x, y, 0 * x], axis=1)
    >>> square = np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0], [2, 2, 0]])
    >>> faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    >>> vertices, _, _ = trimmed_by_distance((square, faces, None), points, 2.0)
    >>> bool((abs(vertices - 2.0) < 8.0).all())
    True
    """
    vertices, faces, densities = mesh
    limit = AUTO_DISTANCE if distance is None or distance == "auto" else float(distance)
    distinct, row = np.unique(points, axis=0, return_index=True)
    spacing = np.maximum(local_spacing(distinct), least)
    tree = KDTree(distinct)
    # Over many points: where the spacing changes from one to the next the border would be torn.
    apart, near = tree.query(vertices, k=min(AROUND, len(distinct)))
    value = apart[:, 0] / (limit * spacing[near].mean(axis=1)) - 1.0
    if where is not None:
        value[~where[row][near[:, 0]]] = -1.0
    if not (value > 0).any():
        return mesh
    vertices, faces, densities = _cut(vertices, faces, densities, value)
    return _compact(vertices, faces[_with_points(vertices, faces, distinct)], densities)


def _cut(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    densities: NDArray[np.float64] | None,
    value: NDArray[np.float64],
) -> Arrays:
    """Leave of each triangle the part where the value, linear along edges, is not above 0."""
    inside = (value <= 0)[faces]
    count = inside.sum(axis=1)
    crossed = np.flatnonzero((count == 1) | (count == 2))
    # The corner that is alone on its side comes first; the turn keeps the orientation.
    alone = (inside[crossed] == (count[crossed] == 1)[:, None]).argmax(axis=1)
    a, b, c = faces[crossed[:, None], (alone[:, None] + np.arange(3)) % 3].T
    edges = np.sort(np.concatenate([np.stack([a, b], axis=1), np.stack([c, a], axis=1)]), axis=1)
    edge, place = np.unique(edges, axis=0, return_inverse=True)
    one, other = edge.T
    share = np.clip(value[one] / (value[one] - value[other]), NEAREST_CUT, 1.0 - NEAREST_CUT)
    ab, ca = (len(vertices) + place.reshape(2, -1)).astype(np.int64)
    single = count[crossed] == 1
    left = [
        faces[count == 3],
        np.stack([a, ab, ca], axis=1)[single],
        np.stack([ab, b, c], axis=1)[~single],
        np.stack([ab, c, ca], axis=1)[~single],
    ]
    new = vertices[one] + share[:, None] * (vertices[other] - vertices[one])
    if densities is not None:
        densities = np.concatenate([densities, densities[one] + share * (densities[other] - densities[one])])
    return np.concatenate([vertices, new]), np.concatenate(left), densities


def _with_points(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which faces (f,) belong to connected pieces that some points have their nearest vertex on."""
    if len(faces) == 0:
        return np.zeros(0, dtype=np.bool_)
    link = coo_matrix(
        (np.ones(2 * len(faces)), (np.tile(faces[:, 0], 2), faces[:, 1:].T.ravel())), shape=(len(vertices),) * 2
    )
    piece = connected_components(link, directed=False)[1]
    used = np.unique(faces)
    nearest = used[KDTree(vertices[used]).query(points)[1]]
    about = np.bincount(piece[nearest], minlength=int(piece.max()) + 1)
    return np.asarray(about[piece[faces[:, 0]]] >= FEWEST_ABOUT)


def _compact(vertices: NDArray[np.float64], faces: NDArray[np.int64], densities: NDArray[np.float64] | None) -> Arrays:
    """Leave out the vertices that no face refers to."""
    used = np.zeros(len(vertices), dtype=np.bool_)
    used[faces] = True
    return vertices[used], (np.cumsum(used) - 1)[faces], None if densities is None else densities[used]
