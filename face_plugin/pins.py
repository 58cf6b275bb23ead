"""Fix the potential at a few vertices of a solved problem, without meshing or factorising again.

Let A be the factorised matrix of the free vertices, u a solution of one scenario and w the solution with the cage at 1 and
the box at 0. Pinning vertices P means to let charges y flow there. By superposition the new potential is

    u + t w + A^-1 E_P y,        E_P: the columns of the unit matrix that belong to P,

with t the rise of the floating conductor's potential u_C. Some pins join the conductor (e = 1), the others are held at
a given value d (e = 0). With the Green's function between the pins, S = E_P^T A^-1 E_P, the pins are where they shall be if

    S y = e (u_C + t) + (1 - e) d - u_P - t w_P.

The net flux out of the conductor, joined pins included, must stay what it was: zero. What y draws out of the cage
is -w_P . y, because the cage row of A^-1 is -w^T; what it adds at the joined pins is e . y; and t adds t c, with c
the flux that w causes, the capacitance of the cage in the box. So

    t c + (e - w_P) . y = 0,

and with r = e - w_P, y = y0 + t S^-1 r, this gives t = -(r . y0) / (c + r . S^-1 r). S is symmetric, positive definite and as
small as P; it takes one solve with the existing factor a pin.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from face_plugin.meshers import CageMesh
from face_plugin.poisson import Poisson, cage_to_box

__all__ = ["MAXIMUM_PINS", "PinnedPoisson", "rim"]

# The Green's function is dense: beyond this many pins, factorising again is faster and smaller.
MAXIMUM_PINS = 2000
# Right-hand sides solved at once: the factor is read once for all of them, and they take memory.
BATCH = 32


class PinnedPoisson:
    """A solved problem whose potential can be fixed at further vertices.

    Parameters
    ----------
    poisson : Poisson

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> from face_plugin.solver import FaCE
    >>> face = FaCE(sphere(200).points)
    >>> vertex = face.poisson.free[:1]
    >>> still = np.zeros((len(face.mesh.vertices), 1))
    >>> charged = PinnedPoisson(face.poisson).solve(still, held=vertex, value=5.0)
    >>> charged[vertex, 0], bool(charged.max() == 5.0)
    (array([5.]), True)
    """

    def __init__(self, poisson: Poisson) -> None:
        self.poisson = poisson
        self._pins = np.empty(0, dtype=np.intp)
        self._green = np.empty((0, 0))

    def solve(
        self,
        potential: NDArray[np.float64],
        *,
        joined: NDArray[np.intp] | None = None,
        held: NDArray[np.intp] | None = None,
        value: float = 0.0,
    ) -> NDArray[np.float64]:
        """Potential of the same scenarios with vertices pinned.

        Parameters
        ----------
        potential : (m, s) float64
            Solutions without pins whose cage floats at zero net charge, as `Poisson.solve` gives them.
        joined : (j,) intp, optional
            Free vertices of the mesh that become part of the floating conductor.
        held : (q,) intp, optional
            Other free vertices, held at `value`.
        value : float
            In the unit of the potential.

        Returns
        -------
        (m, s) float64

        Raises
        ------
        ValueError
            A vertex is not free, is given twice, or there are more than `MAXIMUM_PINS`.
        """
        none = np.empty(0, dtype=np.intp)
        joined, held = none if joined is None else joined, none if held is None else held
        self._check(np.concatenate([joined, held]))
        mesh = self.poisson.mesh
        pins = np.concatenate([rim(mesh, joined), held])
        if len(pins) > MAXIMUM_PINS:
            raise ValueError(
                f"at most {MAXIMUM_PINS} vertices can be pinned, found {len(pins)}: use a smaller radius, "
                "or add positions there to the points"
            )
        if len(pins) == 0:
            return potential.copy()
        joins = np.arange(len(pins)) < len(pins) - len(held)
        cage = potential[np.argmax(mesh.owner >= 0)]
        gap = np.where(joins[:, None], cage, value) - potential[pins]
        r = joins - self._raised[pins]
        factor = cho_factor(self._between(pins), lower=True)
        y0, y1 = cho_solve(factor, gap), cho_solve(factor, r)
        rise = -(r @ y0) / (self._capacitance + r @ y1)
        load = np.zeros((len(self.poisson.free), potential.shape[1]))
        load[np.searchsorted(self.poisson.free, pins)] = y0 + y1[:, None] * rise
        out = potential + self._raised[:, None] * rise
        out[self.poisson.free] += self.poisson.solve_free(load)
        # These are known exactly, and a constant has no gradient only if it is exactly constant.
        out[joined] = cage + rise
        out[held] = value
        return np.asarray(out)

    @cached_property
    def _raised(self) -> NDArray[np.float64]:
        """Potential (m,) with the cage at 1 and the box at 0."""
        grounded = np.zeros((np.count_nonzero(self.poisson.mesh.boundary), 1))
        return self.poisson.solve(grounded, np.ones(1))[:, 0]

    @cached_property
    def _capacitance(self) -> float:
        """Flux out of the cage when it is at 1 and the box at 0; the diagonal is minus the sum of its row."""
        to_free, to_box = self.poisson._to_cage, cage_to_box(self.poisson.mesh)
        return float(to_free @ (self._raised[self.poisson.free] - 1.0) - to_box.sum())

    def _check(self, vertices: NDArray[np.intp]) -> None:
        if len(np.unique(vertices)) < len(vertices) or not np.isin(vertices, self.poisson.free).all():
            raise ValueError("pins must be distinct free vertices of the mesh")

    def _between(self, pins: NDArray[np.intp]) -> NDArray[np.float64]:
        """Green's function (k, k) between the pins; what was solved for once is kept."""
        new = np.setdiff1d(pins, self._pins)
        if len(new):
            old = len(self._pins)
            self._pins = np.concatenate([self._pins, new])
            rows = np.searchsorted(self.poisson.free, self._pins)
            green = np.zeros((len(rows), len(rows)))
            green[:old, :old] = self._green
            for start in range(old, len(rows), BATCH):
                stop = min(start + BATCH, len(rows))
                unit = np.zeros((len(self.poisson.free), stop - start))
                unit[rows[start:stop], np.arange(stop - start)] = 1.0
                green[:, start:stop] = self.poisson.solve_free(unit)[rows]
            green[old:, :old] = green[:old, old:].T
            self._green = green
        order = np.argsort(self._pins)
        at = order[np.searchsorted(self._pins, pins, sorter=order)]
        return self._green[np.ix_(at, at)]


def rim(mesh: CageMesh, joined: NDArray[np.intp]) -> NDArray[np.intp]:
    """Those of the vertices that join the conductor which have a neighbour that is not part of it.

    The others are shielded by the rest: no charge flows to them, and they take the conductor's potential by themselves.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> owner = np.array([-1, 0, 0, 0], dtype=np.int32)
    >>> mesh = CageMesh(corners, np.array([[0, 1, 2, 3]], dtype=np.int32), owner, *3 * [np.zeros(4, dtype=bool)])
    >>> rim(mesh, np.array([0]))
    array([], dtype=int64)
    """
    conducting = mesh.owner >= 0
    inside = np.zeros(len(conducting), dtype=np.bool_)
    inside[joined] = True
    around = mesh.tets[inside[mesh.tets].any(axis=1)]
    exposed = np.zeros(len(conducting), dtype=np.bool_)
    exposed[around[~(conducting | inside)[around].all(axis=1)]] = True
    return joined[exposed[joined]]
