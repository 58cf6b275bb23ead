"""Seams: lines across a smooth sheet where it changes its side, which no sheet does.

Field and winding number judge by what is around: the inner turn of a scroll faces its core, where there is light, and
the outer one the outside, as if both were the two sides of a wall. Where the sheet leads from one to the other, and no
other sheet is near that it might end at, it has one side all the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.graph import Edges, connected_parts
from face_plugin.sides.patches import HOLD_FIELD, SMALLEST, Planes, planes_of

__all__ = ["across_seams", "both_alone"]

# A seam lies at another sheet if that passes within this many spacings.
NEAR_BY = 2.0
# Other sheets are looked for among so many of the nearest points: those that lie more steeply over the tangent plane
# than this (sine).
LOOKED_AROUND = 48
OFF_SHEET = 0.5
# An edge within a smooth sheet says that its ends are, or are not, on one side by more than this.
SMOOTH = 0.5


def across_seams(
    around: Neighbourhood, normals: NDArray[np.float64], says: NDArray[np.float64], planes: Planes | None = None
) -> NDArray[np.bool_]:
    """Find what is to be turned (n,) so that no smooth sheet changes its side: the part of it that less speaks for.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64
        Unit normals.
    says : (n,) float64
        What the field says of them: positive where they point to the lit side.
    planes : Planes, optional
        Those of `around`, where they are known.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    >>> sheet = np.stack([x.ravel(), y.ravel(), 0.1 * np.sin(x.ravel())], axis=1)
    >>> mixed = np.outer(np.where(sheet[:, 0] < 5, -1.0, 1.0), [0.0, 0.0, 1.0])
    >>> across_seams(Neighbourhood(sheet), mixed, np.ones(400)).tolist() == (sheet[:, 0] < 5).tolist()
    True
    """
    count = len(around)
    # Normals bend where sides change, the lines of planes do not.
    lines, edges, coupling, _ = (planes or planes_of(around)).along(normals)
    seam = np.flatnonzero(coupling < -SMOOTH)
    seam = seam[both_alone(around, lines, edges.first[seam], edges.second[seam], NEAR_BY)]
    if len(seam) < SMALLEST:
        return np.zeros(count, dtype=np.bool_)
    same = coupling > SMOOTH
    patch, patches = connected_parts(np.ones(count, dtype=np.bool_), Edges(edges.first[same], edges.second[same]))
    # How many edges lead from one patch to another, and how many of them are a seam.
    pair = np.minimum(patch[edges.first], patch[edges.second]) * patches
    pair += np.maximum(patch[edges.first], patch[edges.second])
    of_seam, across = np.unique(pair[seam], return_counts=True)
    apart = of_seam // patches != of_seam % patches
    pair = np.sort(pair)
    contact = np.searchsorted(pair, of_seam, side="right") - np.searchsorted(pair, of_seam)
    sure = apart & (across >= SMALLEST) & (2 * across > contact)
    sewn = Edges(of_seam[sure] // patches, of_seam[sure] % patches)
    sign = cluster_signs(patches, sewn, -across[sure].astype(np.float64))
    # Which side a sheet has as a whole, its edges to others and the field decide.
    touched = np.zeros(patches, dtype=np.bool_)
    touched[sewn.first] = touched[sewn.second] = True
    sheet = connected_parts(touched, sewn)[0]
    first, second = patch[edges.first], patch[edges.second]
    out = sheet[first] != sheet[second]
    held = np.bincount(patch, HOLD_FIELD * says, patches)
    for inner, outer in ((first[out], second[out]), (second[out], first[out])):
        held += np.bincount(inner, coupling[out] * np.where(touched[outer], sign[outer], 1.0), patches)
    whole = np.bincount(sheet[touched], (held * sign)[touched])
    sign[touched] *= np.where(whole[sheet[touched]] < 0, -1.0, 1.0)
    return np.asarray((touched & (sign < 0))[patch])


def both_alone(
    around: Neighbourhood,
    lines: NDArray[np.float64],
    first: NDArray[np.intp],
    second: NDArray[np.intp],
    within: float,
) -> NDArray[np.bool_]:
    """Whether no other sheet passes near either end of edges (e,).

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    lines : (n, d) float64
        Unit normals of either sign.
    first, second : (e,) intp
        Rows of the ends.
    within : float
        What is near, in spacings.
    """
    ends, row = np.unique(np.concatenate([first, second]), return_inverse=True)
    near, distance = (of[ends, 1 : LOOKED_AROUND + 1] for of in (around.neighbour, around.distance))
    height = np.abs(np.einsum("nkd,nd->nk", around.points[near] - around.points[ends][:, None], lines[ends]))
    other = (height > OFF_SHEET * distance) & (distance < within * around.spacing[ends][:, None])
    is_alone = ~other.any(axis=1)[row]
    return np.asarray(is_alone[: len(first)] & is_alone[len(first) :])
