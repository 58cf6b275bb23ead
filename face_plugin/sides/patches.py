"""Patches of points whose sides are wrong together, and turned together.

In a deep crate, a bore or a slot the field is dark, and a whole patch may take the wrong side; on a terrain it is alike
on both sides, and the sides it gives are a patchwork. The steps of the winding number cannot mend that: within a patch
every point agrees with its neighbours. So a patch is judged as a whole, by three witnesses, each in [-1, 1]:

- **its border**: what the edges across it say. Along a sheet, and across a crease, neighbours know of one another
  (`couplings`); a border that says so with one voice outweighs the others.
- **closure**: the winding number w of all the others is 1/2 at a point of a closed surface, 0 on an open sheet, and 3/2
  or -1/2 where the patch around is inside out. ``1 - 2 |w - 1/2|`` is thus 1 where everything around fits together, and
  no accident makes it so over a whole patch.
- **the field**: how clearly it lights one side and not the other (`FieldAtPoints.lean`).

Which patches to ask about is what `cluster_signs` proposes: once from planes through many neighbours, which noise does
not turn, and by edges alone; then from the normals as they are, with closure and field to hold what fits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from face_plugin.consensus import consensus_lines
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.planes import plane_fits
from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.graph import Edges, connected_parts, couplings, neighbours_around

__all__ = [
    "HOLD_FIELD",
    "SMALLEST",
    "Planes",
    "border",
    "closure",
    "lines_at",
    "planes_of",
    "shared_planes",
    "turned_patches",
    "winding_number",
]

# Neighbours of the plane that a sheet is taken for, as hosts take by default.
PLANE_NEIGHBOURS = 30
# Width of the kernel of the winding number, in spacings.
WIDTH = 0.3
# Evidence of a point next to its couplings, which are 1 at most: closure, and the field.
HOLD_CLOSED = 0.1
HOLD_FIELD = 0.03
# A patch smaller than this is no patch: the steps of the winding number judge it by what is around.
SMALLEST = 12
# What the witnesses count next to the field's 1: a border of one voice outweighs the two others where they are as they
# are on open sheets (0.6 and 0.7 on generated floors and depth frames), and gained closure alone a weak field.
BORDER = 1.5
CLOSURE = 0.8
# By how much they must outweigh the field: less is chance.
MARGIN = 0.08
# Share of a patch that would face sealed space, above which it is left: 0.25 to 0.8 in parts inside of solids, as it is
# not seen in creases and narrow places, and 0 to 0.09 in bores and slots.
SEALED = 0.15
# Mean coupling across a border from which it counts in full: the edges across a right angle have 0.2 to 0.3.
CLEAR = 0.15


def closure(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """How well everything fits together at each point (n,): 1 on a closed surface, 0 on a sheet or inside out.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> bool(closure(Neighbourhood(ball.points), ball.normals).min() > 0.7)
    True
    """
    return np.asarray(np.clip(1.0 - 2.0 * np.abs(winding_number(around, normals) - 0.5), 0.0, 1.0))


def winding_number(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Winding number (n,) of the others at each point: 1/2 on a closed surface, 3/2 or -1/2 where that is inside out.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> bool(np.abs(winding_number(Neighbourhood(ball.points), ball.normals) - 0.5).max() < 0.2)
    True
    """
    return np.asarray(around.tree.number(normals, WIDTH * around.spacing))


class Planes(NamedTuple):
    """Planes through many neighbours of each point, which noise does not turn, and what they say of one another."""

    lines: NDArray[np.float64]
    """(n, 3) unit normals, of either sign."""
    edges: Edges
    """Along the planes."""
    coupling: NDArray[np.float64]
    """(e,) as of `couplings`; less where the points lie on no plane."""
    flatness: NDArray[np.float64]
    """(n,) as of `plane_fits`."""

    def along(self, normals: NDArray[np.float64]) -> Planes:
        """Turn the lines to the side of normals (n, 3)."""
        side = np.where(np.einsum("nd,nd->n", self.lines, normals) < 0, -1.0, 1.0)
        coupling = self.coupling * side[self.edges.first] * side[self.edges.second]
        return self._replace(lines=self.lines * side[:, None], coupling=coupling)


def planes_of(around: Neighbourhood) -> Planes:
    """Find the planes of a neighbourhood: once for all who ask it for sides.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> planes = planes_of(Neighbourhood(sphere(500).points))
    >>> planes.lines.shape, bool((planes.coupling > 0).mean() > 0.4)
    ((500, 3), True)
    """
    return _coupled(around, *_fitted(around, slice(None)))


def shared_planes(around: Neighbourhood, planes: Planes, seen: NDArray[np.float64] | None = None) -> Planes:
    """Find planes that many neighbours share, as `consensus_lines` does, from those of a neighbourhood.

    `seen` (n, 3) are directions in which sensors saw the points, where they are known.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> around = Neighbourhood(sphere(500).points)
    >>> bool((shared_planes(around, planes_of(around)).lines == planes_of(around).lines).all())
    True
    """
    lines = consensus_lines(around, planes.lines, PLANE_NEIGHBOURS, seen)
    return _coupled(around, lines, planes.flatness)


def _coupled(around: Neighbourhood, lines: NDArray[np.float64], flatness: NDArray[np.float64]) -> Planes:
    edges = neighbours_around(around, lines)
    trust = flatness**2
    coupling = couplings(around.points, lines, edges) * trust[edges.first] * trust[edges.second]
    return Planes(lines, edges, coupling, flatness)


def lines_at(around: Neighbourhood, some: slice | NDArray[np.intp] = slice(None)) -> NDArray[np.float64]:
    """Lines (m, 3) of the planes of some points (m,), or of all, as `planes_of` has them.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> around = Neighbourhood(sphere(500).points)
    >>> bool((lines_at(around, np.array([3, 7])) == planes_of(around).lines[[3, 7]]).all())
    True
    """
    return _fitted(around, some)[0]


def _fitted(around: Neighbourhood, some: slice | NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    count = min(PLANE_NEIGHBOURS, len(around) - 1)
    return plane_fits(around.points, around.distance[some], around.neighbour[some], count, 1.0)


def turned_patches(
    around: Neighbourhood,
    normals: NDArray[np.float64],
    field: NDArray[np.float64],
    *,
    planes: Planes | None = None,
    lit: NDArray[np.bool_] | None = None,
    sealed: Callable[[NDArray[np.bool_]], NDArray[np.bool_]] | None = None,
) -> NDArray[np.bool_]:
    """Which points belong to patches that are to be turned as a whole.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64
        Unit normals.
    field : (n,) float64
        What the field says of each normal, in [-1, 1]: positive where it points to the lit side.
    planes : Planes, optional
        Patches of these and by edges alone; by default of the normals as they are.
    lit : (n,) bool, optional
        Points whose closure counts where it is gained; by default all.
    sealed : callable, optional
        Tells of points (n,) that would be turned which of them would face space that is sealed off. A patch much of
        which would is left as it is: it would be the wall of a cavity in matter.

    Returns
    -------
    (n,) bool

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(2000)
    >>> wrong = ball.points[:, 2] > 0.8
    >>> mixed = np.where(wrong[:, None], -ball.normals, ball.normals)
    >>> around = Neighbourhood(ball.points)
    >>> found = turned_patches(around, mixed, np.zeros(2000), planes=planes_of(around))
    >>> bool((found == wrong).mean() > 0.99)
    True
    """
    closed = closure(around, normals)
    if planes is not None:
        _, edges, coupling, _ = planes.along(normals)
        sign = cluster_signs(len(around), edges, coupling)
    else:
        edges = neighbours_around(around, normals)
        coupling = couplings(around.points, normals, edges)
        sign = cluster_signs(len(around), edges, coupling, HOLD_CLOSED * closed + HOLD_FIELD * field)
    turned = np.zeros(len(around), dtype=np.bool_)
    patch, count = connected_parts(sign < 0, edges, SMALLEST)
    if count == 0:
        return turned
    inside = patch >= 0
    then = closure(around, np.where(inside[:, None], -normals, normals))
    says = border(patch, count, sign, edges, coupling)
    members = np.bincount(patch[inside], minlength=count)
    before, after, loss = (
        np.bincount(patch[inside], values[inside], minlength=count) / members for values in (closed, then, field)
    )
    # Parts that lie inside others gain as well, but little comes of it: only what then fits together counts in full.
    counts = 1.0 if lit is None else np.bincount(patch[inside], lit[inside], minlength=count) / members
    gain = np.where(after > before, after * counts, 1.0) * (after - before)
    # The square: a border half of whose edges agree says nothing.
    right = (says > 0) & (BORDER * says**2 + CLOSURE * gain > loss + MARGIN)
    if sealed is not None and right.any():
        asked = inside & right[patch]
        right &= np.bincount(patch[asked], sealed(asked)[asked], minlength=count) <= SEALED * members
    turned[inside] = right[patch[inside]]
    return turned


def border(
    patch: NDArray[np.intp], count: int, sign: NDArray[np.float64], edges: Edges, coupling: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Tell what the edges across the border of each patch say: -1 to 1, positive where it is to be turned.

    Parameters
    ----------
    patch : (n,) intp
        Of each point, as `connected_parts` has it.
    count : int
        Number m of patches.
    sign : (n,) float64
        1 or -1; edges between points that differ in it are the borders.
    edges : Edges
    coupling : (e,) float64

    Returns
    -------
    (m,) float64

    Examples
    --------
    >>> row = Edges(np.arange(3), np.arange(1, 4))
    >>> border(np.array([-1, -1, 0, 0]), 1, np.array([1.0, 1, -1, -1]), row, np.array([0.9, -0.5, 0.9]))
    array([1.])
    """
    across = sign[edges.first] != sign[edges.second]
    says = np.zeros(count)
    weight, number = np.zeros(count), np.zeros(count)
    for ends in (edges.first, edges.second):
        of = patch[ends[across]]
        known = of >= 0
        of, value = of[known], coupling[across][known]
        says -= np.bincount(of, value, minlength=count)
        weight += np.bincount(of, np.abs(value), minlength=count)
        number += np.bincount(of, minlength=count)
    clear = np.minimum(weight / np.maximum(CLEAR * number, 1e-300), 1.0)
    return np.asarray(clear * says / np.maximum(weight, 1e-300))
