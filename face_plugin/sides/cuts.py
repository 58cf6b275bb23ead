"""Sides that a cut betters: what was joined too soon, and speaks against its side as a whole, is turned.

Clusters are joined by what says most, and are never taken apart again: a part may be joined by a few edges before all
that is known of its points has been added up. Of given sides, the set of points that is best turned as a whole is a
minimum cut of the graph (Boykov, Veksler and Zabih 2001), if edges that speak against these sides are left out; with
all edges it is then turned only where that is better.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from face_plugin.sides.clusters import where_better
from face_plugin.sides.graph import Edges

__all__ = ["cut_signs"]

# Capacities are whole numbers: so many to a coupling of 1, and fewer in clouds so large that their sum has no room.
STEPS = 1000
ROOM = 2**30


def cut_signs(
    sign: NDArray[np.float64], edges: Edges, coupling: NDArray[np.float64], evidence: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Signs (n,) of which those are turned that a cut tells apart, if that raises the sum of what speaks for them.

    The sum is that of `face_plugin.sides.clusters.where_better`.

    Parameters
    ----------
    sign : (n,) float64
        1 or -1.
    edges : Edges
    coupling : (e,) float64
        Positive where the lines at both ends are on the same side, negative where they are not.
    evidence : (n,) float64
        Positive where a line points to free space, negative where away from it.

    Examples
    --------
    >>> edges = Edges(np.array([0, 1]), np.array([1, 2]))
    >>> cut_signs(np.ones(3), edges, np.array([0.3, 1.0]), np.array([0.5, 0.1, -0.6]))
    array([ 1., -1., -1.])
    >>> cut_signs(np.ones(3), edges, np.array([0.7, 1.0]), np.array([0.5, 0.1, -0.6]))
    array([1., 1., 1.])
    """
    held, joins = evidence * sign, coupling * sign[edges.first] * sign[edges.second]
    turned = np.where(_best_turned(held, edges, joins), -1.0, 1.0)
    return sign * where_better(turned, edges, joins, held)


def _best_turned(held: NDArray[np.float64], edges: Edges, joins: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find the points (n,) to turn: minimise the sum of what holds them (n,) and of the joins (e,) that this tears."""
    if not (held < 0).any():
        return np.zeros(len(held), dtype=np.bool_)
    count, most = len(held), max(float(np.abs(held).sum()), float(np.abs(joins).max(initial=0.0)))
    scale = min(STEPS, ROOM / most)
    source, sink = count, count + 1
    against, held_by, across = np.flatnonzero(held < 0), np.flatnonzero(held > 0), joins > 0
    one, other, strong = edges.first[across], edges.second[across], joins[across]
    row = np.concatenate([one, other, np.full(len(against), source), held_by])
    column = np.concatenate([other, one, against, np.full(len(held_by), sink)])
    capacity = np.rint(scale * np.concatenate([strong, strong, -held[against], held[held_by]])).astype(np.int32)
    graph = csr_matrix((capacity, (row, column)), shape=(count + 2, count + 2))
    left = graph - maximum_flow(graph, source, sink, method="dinic").flow
    left.eliminate_zeros()
    # What the source still reaches is the smallest of all best sets: the cut does not depend on the order of points.
    best = np.zeros(count + 2, dtype=np.bool_)
    best[breadth_first_order(left, source, return_predecessors=False)] = True
    return np.asarray(best[:count])
