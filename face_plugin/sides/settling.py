"""Sides by what is seen from a place that is only a guess: it does not tear what couplings hold together.

From below the ground the inside of a chair that stands on it is seen through the gap under its feet, and through what
little of it is sampled thinly: next to nothing of each point, but of thousands. The edges that join its feet to the
ground are few, and all say the same. So sums do not decide between the two, but what each says in the mean.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.sides.clusters import better_signs
from face_plugin.sides.cuts import cut_signs
from face_plugin.sides.facing import SIGHT
from face_plugin.sides.graph import Edges, connected_parts
from face_plugin.sides.patches import border

__all__ = ["settled_signs"]


def settled_signs(
    edges: Edges, coupling: NDArray[np.float64], seen: NDArray[np.float64], joined: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Signs (n,) by what is seen from a place, and by couplings.

    The sum of both is largest, as of `cut_signs`, but for parts of which less is seen than their border says: these
    keep the side that couplings alone give them.

    Parameters
    ----------
    edges : Edges
    coupling : (e,) float64
        Positive where the lines at both ends are on the same side, negative where they are not.
    seen : (n,) float64
        In [-1, 1], positive where a line points to the place, as `facing` has it.
    joined : (n,) float64
        1 or -1, by couplings alone.

    Examples
    --------
    >>> row = Edges(np.arange(5), np.arange(1, 6))
    >>> seen = np.array([1.0, 1, 1, -0.4, -0.4, -0.4])
    >>> settled_signs(row, np.full(5, 0.5), seen, np.ones(6))
    array([1., 1., 1., 1., 1., 1.])
    >>> settled_signs(row, np.array([0.5, 0.5, 0.02, 0.5, 0.5]), seen, np.ones(6))
    array([ 1.,  1.,  1., -1., -1., -1.])
    """
    evidence = SIGHT * seen
    joined = joined if (joined * seen).sum() >= 0 else -joined
    grown = better_signs(len(joined), edges, coupling, evidence)

    def said(sign: NDArray[np.float64]) -> float:
        return float((evidence * sign).sum() + (coupling * sign[edges.first] * sign[edges.second]).sum())

    sign = max((cut_signs(start, edges, coupling, evidence) for start in (grown, joined)), key=said)
    torn, count = connected_parts(sign != joined, edges)
    if count == 0:
        return sign
    part = torn >= 0
    held = -border(torn, count, sign * joined, edges, coupling * joined[edges.first] * joined[edges.second])
    gained = np.bincount(torn[part], (seen * sign)[part], count) / np.bincount(torn[part], minlength=count)
    return np.where(part & (held > gained)[torn], joined, sign)
