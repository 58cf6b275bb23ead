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

from face_plugin.sides.contraction import contracted
from face_plugin.sides.graph import Edges, connected_parts

__all__ = ["better_signs", "cluster_signs", "where_better"]


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
    cluster, sign = contracted(count + 1, a, b, weight)
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
