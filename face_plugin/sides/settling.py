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

# What is seen through gaps, or past an edge from below, is seen of few points and at a slant: less than this a point,
# and less than this a point that is seen at all. A part that is truly seen is seen at all angles, at a cosine of 1/2 in
# the mean on a ball and more on a wall. Parts of scans thinned to grids that were seen so falsely had 0.01 to 0.07, and
# 0.02 to 0.33.
LITTLE, SQUARELY = 0.07, 0.4


def settled_signs(
    edges: Edges, coupling: NDArray[np.float64], seen: NDArray[np.float64], joined: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Signs (n,) by what is seen from a place, and by couplings; and what the place is worth.

    The sum of both is largest, as of `cut_signs`, but for parts of which less is seen than their border says, or little
    is seen, and at a slant: these keep the side that couplings alone give them.

    Parameters
    ----------
    edges : Edges
    coupling : (e,) float64
        Positive where the lines at both ends are on the same side, negative where they are not.
    seen : (n,) float64
        In [-1, 1], positive where a line points to the place, as `facing` has it.
    joined : (n,) float64
        1 or -1, by couplings alone.

    Returns
    -------
    sign : (n,) float64
        1 or -1.
    worth : float
        That sum, less what couplings alone come to, a point and in the unit of `seen`: at most 1.

    Examples
    --------
    >>> row = Edges(np.arange(5), np.arange(1, 6))
    >>> seen = np.array([1.0, 1, 1, -0.4, -0.4, -0.4])
    >>> settled_signs(row, np.full(5, 0.5), seen, np.ones(6))[0]
    array([1., 1., 1., 1., 1., 1.])
    >>> settled_signs(row, np.array([0.5, 0.5, 0.02, 0.5, 0.5]), seen, np.ones(6))[0]
    array([ 1.,  1.,  1., -1., -1., -1.])
    """
    evidence = SIGHT * seen
    joined = joined if (joined * seen).sum() >= 0 else -joined
    grown = better_signs(len(joined), edges, coupling, evidence)

    def said(sign: NDArray[np.float64]) -> float:
        return float((evidence * sign).sum() + (coupling * sign[edges.first] * sign[edges.second]).sum())

    sign = max((cut_signs(start, edges, coupling, evidence) for start in (grown, joined)), key=said)
    torn, count = connected_parts(sign != joined, edges)
    if count:
        part = torn >= 0
        held = -border(torn, count, sign * joined, edges, coupling * joined[edges.first] * joined[edges.second])
        members, looked_at, gained = (
            np.bincount(torn[part], of[part], count) for of in (np.ones(len(seen)), seen != 0.0, seen * sign)
        )
        falsely = (gained < LITTLE * members) & (gained < SQUARELY * looked_at)
        keep = (held > gained / members) | ((held > 0.0) & falsely)
        sign = np.where(part & keep[torn], joined, sign)
    alone = said(joined) - float((evidence * joined).sum())
    return sign, (said(sign) - alone) / (SIGHT * len(sign))
