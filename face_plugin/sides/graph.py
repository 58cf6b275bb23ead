"""The graph of neighbours along a sheet, and what each edge says of the sides of its two ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from face_plugin.compiled import compiled
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.threads import in_threads

__all__ = ["Edges", "connected_parts", "couplings", "neighbours_around"]

# The nearest neighbour in each of so many sectors of the tangent plane: scan lines seven times as far apart as the
# points along them are joined to one another, which the nearest neighbours alone never are.
SECTORS = 8


@dataclass(frozen=True)
class Edges:
    """Pairs of points, each once."""

    first: NDArray[np.intp]
    """(e,) row of one end."""
    second: NDArray[np.intp]
    """(e,) row of the other."""


def neighbours_around(around: Neighbourhood, lines: NDArray[np.float64]) -> Edges:
    """Join each point to its nearest neighbour in each sector of its tangent plane, in the plane ahead and back.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    lines : (n, d) float64
        Unit normals of the tangent planes, of either sign.

    Returns
    -------
    Edges

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(5.0), np.arange(5.0))
    >>> sheet = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    >>> edges = neighbours_around(Neighbourhood(sheet), np.tile([0.0, 0.0, 1.0], (25, 1)))
    >>> bool((edges.first < edges.second).all())
    True
    """
    count = len(around)
    found = np.full((count, SECTORS), -1, dtype=np.intp)
    points, neighbour = around.points, np.ascontiguousarray(around.neighbour)
    if around.plane:
        # The plane is one of space: of the sectors of a tangent plane two remain.
        points, lines = (np.column_stack([of, np.zeros(count)]) for of in (points, lines))

    def run(rows: slice) -> None:
        _nearest_in_sectors(rows.start, rows.stop, points, lines, neighbour, found)

    in_threads(run, count)
    one, other = np.repeat(np.arange(count), SECTORS), found.ravel()
    one, other = one[other >= 0], other[other >= 0]
    # Each pair once, in an order that the points alone decide.
    pair = np.sort(np.minimum(one, other) * count + np.maximum(one, other))
    pair = pair[np.diff(pair, prepend=-1) > 0]
    return Edges(pair // count, pair % count)


def couplings(points: NDArray[np.float64], lines: NDArray[np.float64], edges: Edges) -> NDArray[np.float64]:
    """Tell what each edge says of its ends: near 1 where these lines are on one side, near -1 where they are not.

    An arc of a circle that leaves one point along its tangent plane and reaches the other along that one's mirrors the
    first normal at the plane halfway between (Koenig and Gumhold 2009): with e the direction from p_i to p_j, the two
    agree by ``n_i . n_j - 2 (n_i . e) (n_j . e)``. So it is for convex and concave edges, and for the two sides of a
    plate, alike. The more an edge leaves the tangent planes, the less it says: another layer may lie there; its weight
    is ``1 - max((n_i . e)^2, (n_j . e)^2)``.

    Parameters
    ----------
    points, lines : (n, d) float64
    edges : Edges

    Returns
    -------
    (e,) float64
        In [-1, 1].

    Examples
    --------
    >>> corner = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    >>> outward = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    >>> couplings(corner, outward, Edges(np.array([0]), np.array([1]))).round(3)
    array([0.5])
    """
    direction = points[edges.second] - points[edges.first]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    one, other = lines[edges.first], lines[edges.second]
    a, b = np.einsum("ed,ed->e", one, direction), np.einsum("ed,ed->e", other, direction)
    agreement = np.einsum("ed,ed->e", one, other) - 2.0 * a * b
    return np.asarray(agreement * (1.0 - np.maximum(a * a, b * b)))


@compiled(nogil=True)
def _nearest_in_sectors(first, last, points, lines, neighbour, found):  # type: ignore[no-untyped-def]
    sectors = found.shape[1]
    for i in range(first, last):
        n0, n1, n2 = lines[i, 0], lines[i, 1], lines[i, 2]
        # Tangent axes: cross the normal with the coordinate axis that it is farthest from.
        if abs(n0) <= abs(n1) and abs(n0) <= abs(n2):
            x0, x1, x2 = 0.0, n2, -n1
        elif abs(n1) <= abs(n2):
            x0, x1, x2 = -n2, 0.0, n0
        else:
            x0, x1, x2 = n1, -n0, 0.0
        scale = 1.0 / np.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
        x0, x1, x2 = scale * x0, scale * x1, scale * x2
        y0, y1, y2 = n1 * x2 - n2 * x1, n2 * x0 - n0 * x2, n0 * x1 - n1 * x0
        missing = sectors
        for k in range(1, neighbour.shape[1]):
            j = neighbour[i, k]
            d0, d1, d2 = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
            angle = np.arctan2(d0 * y0 + d1 * y1 + d2 * y2, d0 * x0 + d1 * x1 + d2 * x2)
            sector = int((angle / (2.0 * np.pi) + 0.5) * sectors) % sectors
            if found[i, sector] < 0:
                found[i, sector] = j
                missing -= 1
                if missing == 0:
                    break


def connected_parts(chosen: NDArray[np.bool_], edges: Edges, smallest: int = 1) -> tuple[NDArray[np.intp], int]:
    """Find the connected parts of the chosen points.

    Parameters
    ----------
    chosen : (n,) bool
    edges : Edges
    smallest : int
        Parts of fewer points are left out.

    Returns
    -------
    part : (n,) intp
        Of each point; -1 where there is none.
    count : int
        Number of parts.

    Examples
    --------
    >>> edges = Edges(np.array([0, 1, 2]), np.array([1, 2, 3]))
    >>> part, count = connected_parts(np.array([True, True, False, True]), edges)
    >>> part.tolist(), count
    ([0, 0, -1, 1], 2)
    """
    size = len(chosen)
    both = chosen[edges.first] & chosen[edges.second]
    link = coo_matrix((np.ones(int(both.sum())), (edges.first[both], edges.second[both])), shape=(size, size))
    label = connected_components(link, directed=False)[1]
    members = np.bincount(label[chosen], minlength=int(label.max()) + 1)
    large = members >= max(smallest, 1)
    name = np.where(large, np.cumsum(large) - 1, -1)
    return np.where(chosen, name[label], -1), int(large.sum())
