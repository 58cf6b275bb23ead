"""Contraction of a signed graph: the heaviest edges first, those between the same two clusters added up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled

__all__ = ["AT_ONCE", "contracted"]

# Sums within this share of the largest are joined in one round, strongest first. At 0.7 weak joins come before the sums
# that would have overruled them are complete.
AT_ONCE = 0.9


def contracted(
    nodes: int, a: NDArray[np.intp], b: NDArray[np.intp], weight: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Join the ends of the heaviest edges on the sides that these say, and so on until none is left.

    Parameters
    ----------
    nodes : int
        Number m of nodes.
    a, b : (e,) int
        Nodes at both ends of edges, no two of which join the same.
    weight : (e,) float64
        Positive where both ends are on the same side, negative where they are not, 0 where there is no edge.

    Returns
    -------
    cluster : (m,) intp
        One node of the cluster that each node ends up in.
    sign : (m,) float64
        1 or -1: the side of the node relative to that one.

    Examples
    --------
    >>> cluster, sign = contracted(3, np.array([0, 1, 0]), np.array([1, 2, 2]), np.array([1.0, -1.0, 0.5]))
    >>> len(set(cluster)), (sign * sign[0]).tolist()
    (1, [1.0, 1.0, -1.0])
    """
    kept = weight != 0
    a, b, weight = a[kept].astype(np.int64), b[kept].astype(np.int64), weight[kept].astype(np.float64)
    size = len(a)
    cluster, sign = np.arange(nodes), np.ones(nodes)
    # Half-edges 2 e and 2 e + 1 lie at a[e] and b[e]: of each node the first and the last, and after each the next.
    first, last, degree, after = (
        np.full(nodes, -1),
        np.full(nodes, -1),
        np.zeros(nodes, np.int64),
        np.full(2 * size, -1),
    )
    # A power of two, at most half of which is filled.
    slots = 2 << (2 * size).bit_length()
    key, value = np.full(slots, -1), np.zeros(slots, np.int64)
    # Each edge once, and again each time that another is added to it.
    heap, mass = np.zeros(2 * size + 1, np.int64), np.zeros(2 * size + 1)
    batch = np.zeros((2, size), np.int64), np.zeros(size)
    _contract(a, b, weight, cluster, sign, first, last, degree, after, key, value, heap, mass, *batch)
    return cluster, sign


@compiled()
def _contract(a, b, weight, cluster, sign, first, last, degree, after, key, value, heap, mass, ends, side):  # type: ignore[no-untyped-def]
    """Join the ends of edges within a share of the largest, add up edges that are double then, and so on to the last.

    In the end `cluster` names one node of each node's cluster, and `sign` is the side relative to that one. Of two
    clusters the smaller is joined to the larger: its edges, a linked list, are carried over, and a hash table of pairs
    tells which of them the larger has already. The heap's entries of edges whose weights have changed are passed over.
    """
    nodes, size, slots = len(cluster), len(a), len(key)
    filled, entries = size, 0
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
                least = max(least, AT_ONCE * heavy)
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
                for k in range(slots):
                    key[k] = -1
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
