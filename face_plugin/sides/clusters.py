"""Sides by joining what says most first: clusters of a signed graph, grown from its strongest couplings.

Sides that spread along single strongest edges, as a minimum spanning tree has them (Hoppe et al. 1992), go wrong where
one edge lies. Here all edges between two clusters speak together: the two whose edges sum to most, in absolute value,
are joined first, on the sides that the sum says, and their edges to others are added up (greedy additive edge
contraction, Keuper et al. 2015, on signs). What is known of single points' sides takes part as edges to one more node,
free space itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.sides.graph import Edges, connected_parts

__all__ = ["better_signs", "cluster_signs"]

# Sums within this share of the largest are joined in one round, strongest first. At 1 each round would join one pair;
# at 0.7 weak joins come before the sums that would have overruled them are complete.
SHARE = 0.9
# Below this largest sum the order no longer matters: chance decides.
FAINT, SHARE_OF_FAINT = 1e-3, 0.1


def cluster_signs(
    count: int, edges: Edges, coupling: NDArray[np.float64], evidence: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Sides of points: 1 where a line is on its side already, -1 where it is to be turned.

    Parameters
    ----------
    count : int
        Number n of points.
    edges : Edges
    coupling : (e,) float64
        Positive where the lines at both ends are on the same side, negative where they are not.
    evidence : (n,) float64, optional
        Positive where a line points to free space, negative where away from it; by default nothing is known.

    Returns
    -------
    (n,) float64
        1 or -1. A component that no evidence reaches keeps the side of most of its lines.

    Examples
    --------
    >>> edges = Edges(np.array([0, 1, 0]), np.array([1, 2, 2]))
    >>> cluster_signs(3, edges, np.array([1.0, -1.0, 0.5]), np.array([0.0, 0.0, 0.1]))
    array([-1., -1.,  1.])
    """
    a, b, weight = edges.first, edges.second, coupling
    space = count
    if evidence is not None:
        a, b = np.concatenate([a, np.arange(count)]), np.concatenate([b, np.full(count, space)])
        weight = np.concatenate([weight, evidence])
    kept = weight != 0
    a, b, weight = a[kept], b[kept], weight[kept]
    cluster, sign, clusters = np.arange(count + 1), np.ones(count + 1), count + 1
    while len(weight):
        size = np.abs(weight)
        largest = size.max()
        strong = np.flatnonzero(size >= (SHARE if largest > FAINT else SHARE_OF_FAINT) * largest)
        order = strong[np.argsort(-size[strong], kind="stable")]
        parent, flip = np.arange(clusters), np.ones(clusters)
        _join(order, a, b, weight, parent, flip)
        name = np.cumsum(parent == np.arange(clusters)) - 1
        sign *= flip[cluster]
        cluster = name[parent[cluster]]
        weight = weight * flip[a] * flip[b]
        a, b, clusters = name[parent[a]], name[parent[b]], int(name[-1]) + 1
        a, b, weight = _added_up(a, b, weight, clusters)
    return _turned_to_most(sign[:count], cluster[:count], cluster[space])


def better_signs(
    count: int, edges: Edges, coupling: NDArray[np.float64], evidence: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Sides of points as of `cluster_signs`, where they are better than leaving all lines as they are.

    What is joined first on a wrong side draws in what comes later. So each connected part that is to be turned is held
    against leaving it: it is turned if that raises the sum of evidence and couplings, ``sum_i e_i s_i + sum_ij c_ij s_i
    s_j``.

    Parameters
    ----------
    count, edges, coupling, evidence
        As of `cluster_signs`.

    Examples
    --------
    >>> edges = Edges(np.array([0, 1, 0]), np.array([1, 2, 2]))
    >>> better_signs(3, edges, np.array([1.0, -1.0, 0.5]), np.array([0.1, 0.1, 0.1]))
    array([ 1.,  1., -1.])
    """
    sign = cluster_signs(count, edges, coupling, evidence)
    part, parts = connected_parts(sign < 0, edges)
    turned = part >= 0
    held = np.bincount(part[turned], evidence[turned], parts)
    across = sign[edges.first] != sign[edges.second]
    end = np.maximum(part[edges.first], part[edges.second])[across]
    held += np.bincount(end, coupling[across], parts)
    sign[turned] = np.where(held < 0, -1.0, 1.0)[part[turned]]
    return sign


def _added_up(
    a: NDArray[np.intp], b: NDArray[np.intp], weight: NDArray[np.float64], clusters: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Edges between different clusters, those between the same two as one."""
    kept = a != b
    a, b, weight = a[kept], b[kept], weight[kept]
    pair = np.minimum(a, b) * clusters + np.maximum(a, b)
    order = np.argsort(pair, kind="stable")
    pair = pair[order]
    start = np.flatnonzero(np.diff(pair, prepend=-1))
    if len(start) == 0:
        return a, b, weight
    total = np.add.reduceat(weight[order], start)
    a, b = pair[start] // clusters, pair[start] % clusters
    kept = total != 0
    return a[kept], b[kept], total[kept]


def _turned_to_most(sign: NDArray[np.float64], cluster: NDArray[np.intp], known: np.intp) -> NDArray[np.float64]:
    """Turn each cluster but the known one so that most of its lines keep their side."""
    kept = np.bincount(cluster, sign, minlength=int(cluster.max()) + 1)
    turn = np.where(kept < 0, -1.0, 1.0)
    if known < len(turn):
        turn[known] = 1.0
    return np.asarray(sign * turn[cluster])


@compiled()
def _join(order, a, b, weight, parent, flip):  # type: ignore[no-untyped-def]
    """Union-find with signs: `flip` is the side of a cluster relative to its parent, in the end to its root."""
    last = len(parent) - 1
    for e in order:
        x, fx = a[e], 1.0
        while parent[x] != x:
            fx *= flip[x]
            x = parent[x]
        y, fy = b[e], 1.0
        while parent[y] != y:
            fy *= flip[y]
            y = parent[y]
        if x == y:
            continue
        # Free space, the last one, stays a root: it is never turned.
        if x == last:
            x, y = y, x
        parent[x] = y
        flip[x] = fx * fy if weight[e] > 0 else -fx * fy
    for k in range(len(parent)):
        x, fx = k, 1.0
        while parent[x] != x:
            fx *= flip[x]
            x = parent[x]
        y = k
        while parent[y] != y:
            following, rest = parent[y], fx * flip[y]
            parent[y], flip[y] = x, fx
            fx, y = rest, following
