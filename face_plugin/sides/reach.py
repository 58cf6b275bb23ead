"""Reach: what free space gets to through gaps wider than the sampling is free space as well, however dark it is there.

In a bottle, a vase or a shelf the field fades, and what is left of it may have come through the wall. The points alone
tell: in their Delaunay tetrahedra, free space spreads from outside as a ball that is wider than the gaps of the
sampling. A point with free space on one side, and none on the other, knows its side.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from face_plugin.faraday.meshers.delaunay import tetrahedralize
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.alpha_shape import AlphaShapes
from face_plugin.sides.clusters import cluster_signs, where_better
from face_plugin.sides.graph import connected_parts, couplings, neighbours_around
from face_plugin.sides.patches import SMALLEST, winding_number

__all__ = ["Reach", "out_of_reach"]

# Radius of the ball that free space spreads as, in spacings: the least, for even samplings, and so much more a unit of
# the coefficient of variation of the nearest distances, which is 0.05 to 0.1 on even samplings and 0.52 at random.
# There, the circle around one facet in ten thousand is wider.
WIDE, WIDER = 1.25, 1.5
# Balls that are tried, in that radius: at random the widest gap of a million points is half as wide again as that of
# ten thousand.
WIDENED = (1.0, 1.15, 1.3, 1.5)
# Space is wide if a ball so much larger fits in: in a bore that the ball does not get into, gaps of its wall make room
# for one as large here and there.
ROOMY = 1.15
# Free space gets to a point that has it on one side by this share more than on the other, and among points that others
# seem to enclose if to so many of them: 0.75 to 0.85 where scans of rooms are merged and thinned to a grid, as what
# stands in them left shadows; 0 in bodies with others inside, and up to 0.48 in sketches of sparse strokes.
ONE_SIDED, MOST = 0.5, 0.6
# Points are moved by at most so many spacings before they are meshed: rows are the worst case of meshers.
OUT_OF_ROWS = 1e-3
# A point is inside out where the winding number of the others is farther than this from the surface's 1/2.
INSIDE_OUT = 0.5
# Weight of what is reached next to the couplings of a point to its neighbours, which are 1 at most each, when patches
# are looked for: across a thin wall these are as many as along it. A patch is turned if its evidence, without that
# weight, is more than the couplings around it: in cavities these are 0.75 of it at most. Between the layers of
# misregistered scans, where as much is reached as is not, they are twice as much and more.
CERTAIN = 4.0
# A patch that is turned must fit in: how far its winding numbers are from 1/2 then, next to how far they were. In
# cavities it is 0.05 to 0.25; in the layers of misregistered scans, where all of them are off, 0.4 and more.
FITS = 1 / 3


class Reach:
    """Where free space gets to between points, and on which side of them that is.

    Of several balls that one counts that leaves most points with free space on one side alone: a single gap of the
    sampling lets a ball in, and then all is reached; one that is too wide gets into no cavity.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    mesh : Delaunay, optional
        Of `Reach.out_of_rows`; by default the fastest mesher at hand makes one.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> reach = Reach(Neighbourhood(ball.points))
    >>> bool(reach.evidence(ball.normals).mean() > 0.9), bool(reach.evidence(-ball.normals).mean() < -0.9)
    (True, True)
    """

    def __init__(self, around: Neighbourhood, mesh: Delaunay | None = None) -> None:
        self.around = around
        self._mesh = mesh

    @staticmethod
    def out_of_rows(around: Neighbourhood) -> NDArray[np.float64]:
        """Points (n, 3), moved a little."""
        moved = np.random.default_rng(0).uniform(-OUT_OF_ROWS, OUT_OF_ROWS, around.points.shape)
        return np.asarray(around.points + moved * around.spacing[:, None])

    @cached_property
    def _corners(self) -> NDArray[np.int32]:
        """Of the tetrahedra (t, 4) between the points."""
        return tetrahedralize(self.out_of_rows(self.around)) if self._mesh is None else self._mesh.simplices

    @cached_property
    def _shapes(self) -> AlphaShapes:
        return AlphaShapes(self.around.points, self._corners)

    @cached_property
    def _reached(self) -> list[tuple[NDArray[np.float64], NDArray[np.bool_]]]:
        """Radii (n,) of each ball, and the tetrahedra (t,) that it gets to."""
        nearest = self.around.distance[:, 1]
        ball = (WIDE + WIDER * float(nearest.std() / nearest.mean())) * self.around.spacing
        return [(widening * ball, self._shapes.outside(widening * ball)) for widening in WIDENED]

    def _in_front(self, normals: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether tetrahedra lie in front of each of their corners (t, 4)."""
        # Their middle c lies in front of a corner p: 4 n . (c - p) = n . (sum of corners - 4 p).
        points = self.around.points
        total = points[self._corners[:, 0]] + points[self._corners[:, 1]]
        total += points[self._corners[:, 2]] + points[self._corners[:, 3]]
        height = 4.0 * np.einsum("nd,nd->n", points, normals)
        sides = [np.einsum("nd,nd->n", total, normals[corner]) > height[corner] for corner in self._corners.T]
        return np.stack(sides, axis=1)

    def _share(self, there: NDArray[np.bool_], chosen: NDArray[np.bool_], beyond: float) -> NDArray[np.float64]:
        """Share (n,) of the tetrahedra that lie `there` (t, 4) of each point that are chosen (t,)."""
        count = np.bincount(self._corners[there], minlength=len(self.around))
        found = np.bincount(self._corners[there & chosen[:, None]], minlength=len(self.around))
        # Beyond the hull there are none.
        return np.where(count > 0, found / np.maximum(count, 1), beyond)

    def _says(self, in_front: NDArray[np.bool_], free: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Share (n,) of the tetrahedra in front of each point that are free (t,), less that of those behind it."""
        return self._share(in_front, free, 1.0) - self._share(~in_front, free, 1.0)

    def _best(self, in_front: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
        """Ball that tells most, what it reaches, and what that says (n,) of normals."""
        says = [self._says(in_front, free) for _, free in self._reached]
        best = int(np.argmax([np.abs(of).mean() for of in says]))
        return *self._reached[best], says[best]

    def evidence(self, normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tell how far free space gets to each point on the side that its normal points to, and to the other not.

        Parameters
        ----------
        normals : (n, 3) float64

        Returns
        -------
        (n,) float64
            Share of the tetrahedra in front of a point that are reached, less that of those behind it: 1 where the
            normal is right for certain, -1 where it is wrong, 0 where both sides are alike.
        """
        return self._best(self._in_front(normals))[2]

    def sealed_behind(self, normals: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which points (n,) have space behind them that is wide, and that free space does not get to from outside.

        Matter is, and so is the inside of a body within another. What faces it is the wall of a cavity.

        Examples
        --------
        >>> from face_plugin.shapes import sphere
        >>> ball = sphere(500)
        >>> reach = Reach(Neighbourhood(ball.points))
        >>> bool(reach.sealed_behind(ball.normals).mean() > 0.9), bool(reach.sealed_behind(-ball.normals).any())
        (True, False)
        """
        in_front = self._in_front(normals)
        ball, reached, _ = self._best(in_front)
        sealed = self._shapes.roomy(ROOMY * ball) & ~reached
        return self._share(~in_front, sealed, 0.0) > 0.5

    def gets_among(self, enclosed: NDArray[np.bool_], normals: NDArray[np.float64]) -> bool:
        """Tell whether free space gets to most of the points (n,) that others seem to enclose: then nothing does.

        The least ball gets to most, and what it does not get to is enclosed. Where it does get, a single gap of the
        sampling may have let it in, and the ball that tells most decides.

        Examples
        --------
        >>> from face_plugin.shapes import nested_box
        >>> box = nested_box(2000)
        >>> around = Neighbourhood(box.points)
        >>> Reach(around).gets_among(box.interior, box.normals), Reach(around).gets_among(~box.interior, box.normals)
        (False, True)
        """
        in_front = self._in_front(normals)

        def among(says: NDArray[np.float64]) -> bool:
            return bool(enclosed.any() and (np.abs(says[enclosed]) > ONE_SIDED).mean() > MOST)

        return among(self._says(in_front, self._reached[0][1])) and among(self._best(in_front)[2])

    @classmethod
    def places(
        cls, around: Neighbourhood, normals: NDArray[np.float64], places: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Which places (k, 3) free space gets to from outside, past points with these normals (n, 3).

        Examples
        --------
        >>> from face_plugin.shapes import cup
        >>> mug = cup(3000)
        >>> places = np.array([[0.0, 0.0, 0.7], [0.0, 0.0, 0.95], [0.55, 0.0, 0.3]])
        >>> Reach.places(Neighbourhood(mug.points), mug.normals, places).tolist()
        [True, True, False]
        """
        mesh = Delaunay(cls.out_of_rows(around))
        reach = cls(around, mesh)
        reached = reach._best(reach._in_front(normals))[1]
        at = mesh.find_simplex(places)
        return np.asarray((at < 0) | reached[at])


def out_of_reach(reach: Reach, normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find patches to turn (n,): what lies behind them is reached from outside, and what lies in front is not.

    Looked for only where the winding number says that something is inside out, and is more than a crease.

    Parameters
    ----------
    reach : Reach
        Of n points.
    normals : (n, 3) float64
        Unit normals.

    Examples
    --------
    >>> from face_plugin.shapes import cup
    >>> mug = cup(3000)
    >>> inner = np.einsum("nd,nd->n", mug.points * [1, 1, 0], mug.normals) < -0.1
    >>> wrong = np.where(inner[:, None], -mug.normals, mug.normals)
    >>> turned = out_of_reach(Reach(Neighbourhood(mug.points)), wrong)
    >>> bool((turned == inner).mean() > 0.99)
    True
    """
    around = reach.around
    found = np.zeros(len(around), dtype=np.bool_)
    edges = neighbours_around(around, normals)
    off = np.abs(winding_number(around, normals) - 0.5)
    # In a sharp crease the number is off as well, along a line of points; a line across the cloud has the root of n.
    if connected_parts(off > INSIDE_OUT, edges, max(SMALLEST, math.isqrt(len(around))))[1] == 0:
        return found
    reached = reach.evidence(normals)
    coupling = couplings(around.points, normals, edges)
    sign = where_better(cluster_signs(len(around), edges, coupling, CERTAIN * reached), edges, coupling, reached)
    # Less than a patch is a point deep in the band in which points scatter.
    patch, count = connected_parts(sign < 0, edges, SMALLEST)
    turned = patch >= 0
    then = np.abs(winding_number(around, np.where(turned[:, None], -normals, normals)) - 0.5)
    inside_out, before, after = (
        np.bincount(patch[turned], values[turned], count) for values in (off > INSIDE_OUT, off, then)
    )
    found[turned] = ((inside_out >= SMALLEST) & (after < FITS * before))[patch[turned]]
    return found
