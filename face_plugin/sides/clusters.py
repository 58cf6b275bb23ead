"""Sides by joining what says most first: clusters of a signed graph, grown from its strongest couplings.

Sides that spread along single strongest edges, as a minimum spanning tree has them (Hoppe et al. 1992), go wrong where
one edge lies. Here all edges between two clusters speak together: the two whose edges sum to most, in absolute value,
are joined first, on the sides that the sum says, and their edges to others are added up (greedy additive edge
contraction, Keuper et al. 2015, on signs). It goes in rounds: were one pair joined at a time, a single cluster would
grow from the first, and draw in what lies across an edge of the surface by the mere number of neighbours it has there.
What is known of single points' sides takes part as edges to one more node, free space itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.sides.graph import Edges, connected_parts

__all__ = ["better_signs", "cluster_signs", "where_better"]

# Sums within this share of the largest are joined in one round, strongest first. At 0.7 weak joins come before the sums
# that would have overruled them are complete.
SHARE = 0.9


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
    a, b, weight = a[kept].astype(np.int64), b[kept].astype(np.int64), weight[kept].astype(np.float64)
    cluster, sign = np.arange(count + 1), np.ones(count + 1)
    _contract(a, b, weight, cluster, sign)
    # Free space keeps its side; other clusters take that of most of their lines.
    sign *= sign[space]
    turn = np.where(np.bincount(cluster[:space], sign[:space], minlength=count + 1) < 0, -1.0, 1.0)
    turn[cluster[space]] = 1.0
    return np.asarray((sign * turn[cluster])[:space])


def better_signs(
    count: int, edges: Edges, coupling: NDArray[np.float64], evidence: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Sides of points as of `cluster_signs`, where they are better than leaving all lines as they are.

    What is joined first on a wrong side draws in what comes later. So each connected part that is to be turned is held
    against leaving it, as of `where_better`.

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
    return where_better(cluster_signs(count, edges, coupling, evidence), edges, coupling, evidence)


def where_better(
    sign: NDArray[np.float64], edges: Edges, coupling: NDArray[np.float64], evidence: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Signs (n,) of which each connected part of -1 is 1 again, if that does not lower the sum of what speaks for them.

    The sum is that of evidence and couplings, ``sum_i e_i s_i + sum_ij c_ij s_i s_j``.

    Parameters
    ----------
    sign : (n,) float64
        1 or -1.
    edges, coupling, evidence
        As of `cluster_signs`.

    Examples
    --------
    >>> edges = Edges(np.array([0, 1]), np.array([1, 2]))
    >>> where_better(np.array([1.0, 1.0, -1.0]), edges, np.array([1.0, 0.5]), np.array([0.1, 0.1, -0.6]))
    array([ 1.,  1., -1.])
    >>> where_better(np.array([1.0, 1.0, -1.0]), edges, np.array([1.0, 0.5]), np.array([0.1, 0.1, -0.4]))
    array([1., 1., 1.])
    """
    part, parts = connected_parts(sign < 0, edges)
    turned = part >= 0
    held = np.bincount(part[turned], evidence[turned], parts)
    across = sign[edges.first] != sign[edges.second]
    end = np.maximum(part[edges.first], part[edges.second])[across]
    held += np.bincount(end, coupling[across], parts)
    worse = np.zeros(len(sign), dtype=np.bool_)
    worse[turned] = held[part[turned]] >= 0
    return np.where(worse, 1.0, sign)


@compiled()
def _contract(a, b, weight, cluster, sign):  # type: ignore[no-untyped-def]
    """Join the ends of edges within a share of the largest, add up edges that are double then, and so on to the last.

    In the end `cluster` names one node of each node's cluster, and `sign` is the side relative to that one. Of two
    clusters the smaller is joined to the larger: its edges, a linked list, are carried over, and a hash table of pairs
    tells which of them the larger has already. The heap's entries of edges whose weights have changed are passed over.
    """
    nodes, size = len(cluster), len(a)
    # Half-edges 2 e and 2 e + 1 lie at a[e] and b[e].
    first, last, degree = np.full(nodes, -1), np.full(nodes, -1), np.zeros(nodes, dtype=np.int64)
    after = np.full(2 * size, -1)
    slots = 4
    while slots < 4 * size:
        slots *= 2
    key, value, filled = np.full(slots, -1), np.zeros(slots, dtype=np.int64), size
    heap, mass, entries = np.zeros(2 * size + 1, dtype=np.int64), np.zeros(2 * size + 1), 0
    ends, side = np.zeros((2, size), dtype=np.int64), np.zeros(size)
    for e in range(size):
        for half in range(2 * e, 2 * e + 2):
            node = b[e] if half & 1 else a[e]
            if last[node] < 0:
                first[node] = half
            else:
                after[last[node]] = half
            last[node] = half
            degree[node] += 1
        k = _slot(key, min(a[e], b[e]) * nodes + max(a[e], b[e]))
        key[k], value[k] = min(a[e], b[e]) * nodes + max(a[e], b[e]), e
        _push(heap, mass, entries, e, abs(weight[e]))
        entries += 1
    while entries > 0:
        least, batch = 0.0, 0
        while entries > 0 and mass[0] >= least:
            e, heavy = heap[0], mass[0]
            entries -= 1
            _pop(heap, mass, entries)
            if heavy > 0.0 and abs(weight[e]) == heavy:
                least = max(least, SHARE * heavy)
                ends[0, batch], ends[1, batch], side[batch] = a[e], b[e], 1.0 if weight[e] > 0.0 else -1.0
                batch += 1
        for j in range(batch):
            x, y, turn = ends[0, j], ends[1, j], side[j]
            while cluster[x] != x:
                turn *= sign[x]
                x = cluster[x]
            while cluster[y] != y:
                turn *= sign[y]
                y = cluster[y]
            if x == y:
                continue
            if degree[x] > degree[y]:
                x, y = y, x
            cluster[x], sign[x] = y, turn
            degree[y] += degree[x]
            half = first[x]
            while half >= 0:
                following, f = after[half], half >> 1
                if weight[f] != 0.0:
                    other = a[f] if half & 1 else b[f]
                    pair = min(y, other) * nodes + max(y, other)
                    k = _slot(key, pair)
                    g = value[k]
                    if other == y:
                        weight[f] = 0.0
                    elif key[k] == pair and weight[g] != 0.0:
                        weight[g] += turn * weight[f]
                        weight[f] = 0.0
                        _push(heap, mass, entries, g, abs(weight[g]))
                        entries += 1
                    else:
                        filled += key[k] != pair
                        key[k], value[k] = pair, f
                        weight[f] *= turn
                        if half & 1:
                            b[f] = y
                        else:
                            a[f] = y
                        after[half] = -1
                        if last[y] < 0:
                            first[y] = half
                        else:
                            after[last[y]] = half
                        last[y] = half
                half = following
            if 2 * filled > slots:
                # Pairs of clusters that are joined since fill the table.
                key[:] = -1
                filled = 0
                for f in range(size):
                    if weight[f] != 0.0:
                        pair = min(a[f], b[f]) * nodes + max(a[f], b[f])
                        k = _slot(key, pair)
                        key[k], value[k] = pair, f
                        filled += 1
    for node in range(nodes):
        root, total = node, 1.0
        while cluster[root] != root:
            total *= sign[root]
            root = cluster[root]
        x = node
        while cluster[x] != root and x != root:
            following, rest = cluster[x], total * sign[x]
            cluster[x], sign[x] = root, total
            x, total = following, rest


@compiled()
def _slot(key, pair):  # type: ignore[no-untyped-def]
    """Where a pair stands in the table, or would."""
    last = len(key) - 1
    k = ((pair ^ (pair >> 17)) * 2654435761) & last
    while key[k] != -1 and key[k] != pair:
        k = (k + 1) & last
    return k


@compiled()
def _push(heap, mass, entries, edge, heavy):  # type: ignore[no-untyped-def]
    """Put an edge into the heap, the heaviest on top; of two as heavy, the one of the lower row."""
    place = entries
    while place > 0:
        above = (place - 1) // 2
        if mass[above] > heavy or (mass[above] == heavy and heap[above] <= edge):
            break
        heap[place], mass[place] = heap[above], mass[above]
        place = above
    heap[place], mass[place] = edge, heavy


@compiled()
def _pop(heap, mass, entries):  # type: ignore[no-untyped-def]
    """Take the top from the heap, of which so many entries are left."""
    edge, heavy = heap[entries], mass[entries]
    place, below = 0, 1
    while below < entries:
        if below + 1 < entries and (
            mass[below + 1] > mass[below] or (mass[below + 1] == mass[below] and heap[below + 1] < heap[below])
        ):
            below += 1
        if heavy > mass[below] or (heavy == mass[below] and edge <= heap[below]):
            break
        heap[place], mass[place] = heap[below], mass[below]
        place, below = below, 2 * below + 1
    heap[place], mass[place] = edge, heavy
