"""Fix the potential at a few vertices of a solved problem, without meshing or factorising again.

Let A be the factorised matrix of the free vertices, u a solution of one scenario and w the solution with the
cage at 1 and the box at 0. Pinning vertices P means to let charges y flow there. By superposition the new
potential is

    u + t w + A^-1 E_P y,        E_P: the columns of the unit matrix that belong to P,

with t the rise of the floating conductor's potential u_C. Some pins join the conductor (e = 1), the others
are held at a given value d (e = 0). With the Green's function between the pins, S = E_P^T A^-1 E_P, the pins
are where they shall be if

    S y = e (u_C + t) + (1 - e) d - u_P - t w_P.

The net flux out of the conductor, joined pins included, must stay what it was: zero. What y draws out of the
cage is -w_P . y, because -w is what the cage's row makes of A^-1; what it adds at the joined pins is e . y;
and t adds t c, with c the flux that w causes, the capacitance of the cage in the box. So

    t c + (e - w_P) . y = 0,

and with r = e - w_P and y = y0 + t S^-1 r, this gives t = -(r . y0) / (c + r . S^-1 r).

S is symmetric and positive definite. To form it takes a solve a pin. Instead, S y = b is solved by conjugate
gradients: one solve an iteration, for all scenarios at once. S^-1 is the Schur complement of A on P; that
of the part of A within `RINGS` edges of P is a preconditioner so good that three to six iterations do.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.errors import FaceError
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.poisson import Poisson, cage_to_box, factorise

__all__ = ["PinnedPoisson", "rim"]

# Extent of the preconditioner, in edges: 2 take 7 iterations, 4 take 4, 6 take 3 but more time for
# themselves.
RINGS = 4
# Largest error of a pinned potential, relative to its change.
TOLERANCE = 1e-10
ITERATIONS = 200

Operator = Callable[[NDArray[np.float64]], NDArray[np.float64]]


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
            A vertex is not free, or is given twice.
        FaceError
            The conjugate gradients did not converge.
        """
        none = np.empty(0, dtype=np.intp)
        joined, held = none if joined is None else joined, none if held is None else held
        mesh, free = self.poisson.mesh, self.poisson.free
        every = np.concatenate([joined, held])
        if len(np.unique(every)) < len(every) or not np.isin(every, free).all():
            raise ValueError("pins must be distinct free vertices of the mesh")
        pins = np.concatenate([rim(mesh, joined), held])
        out: NDArray[np.float64] = potential.copy()
        cage = potential[np.argmax(mesh.owner >= 0)]
        if len(pins) == 0:
            out[joined] = cage
            return out
        joins = np.arange(len(pins)) < len(pins) - len(held)
        gap = np.where(joins[:, None], cage, value) - potential[pins]
        r = joins - self._raised[pins]
        y, drawn = self._charges(np.searchsorted(free, pins), np.column_stack([gap, r]))
        rise = -(r @ y[:, :-1]) / (self._capacitance + r @ y[:, -1])
        out += self._raised[:, None] * rise
        out[free] += drawn[:, :-1] + drawn[:, -1:] * rise
        # These are known exactly, and a constant has no gradient only if it is exactly constant.
        out[joined] = cage + rise
        out[held] = value
        return out

    @cached_property
    def _raised(self) -> NDArray[np.float64]:
        """Potential (m,) with the cage at 1 and the box at 0."""
        grounded = np.zeros((np.count_nonzero(self.poisson.mesh.boundary), 1))
        raised: NDArray[np.float64] = self.poisson.solve(grounded, np.ones(1))[:, 0]
        return raised

    @cached_property
    def _capacitance(self) -> float:
        """Flux out of the cage when it is at 1 and the box at 0; the diagonal is minus the sum of its row."""
        to_free, to_box = self.poisson._to_cage, cage_to_box(self.poisson.mesh)
        return float(to_free @ (self._raised[self.poisson.free] - 1.0) - to_box.sum())

    def _charges(
        self, place: NDArray[np.intp], wanted: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Charges y (k, s) with S y = `wanted` at the free rows `place`, and A^-1 E_P y (f, s)."""
        precondition = self._local_schur(place)
        limit = TOLERANCE * np.abs(wanted).max(axis=0)
        y, drawn = np.zeros_like(wanted), np.zeros((len(self.poisson.free), wanted.shape[1]))
        rest, direction, before = wanted.copy(), np.zeros_like(wanted), np.ones(wanted.shape[1])
        for _ in range(ITERATIONS):
            # Only what has not converged: a residual of zero has no direction left.
            k = np.flatnonzero(np.abs(rest).max(axis=0) > limit)
            if len(k) == 0:
                return y, drawn
            steep = precondition(rest[:, k])
            slope = (rest[:, k] * steep).sum(axis=0)
            direction[:, k] = steep + direction[:, k] * (slope / before[k])
            before[k] = slope
            load = np.zeros((len(drawn), len(k)))
            load[place] = direction[:, k]
            response = self.poisson.solve_free(load)
            step = slope / (direction[:, k] * response[place]).sum(axis=0)
            y[:, k] += step * direction[:, k]
            drawn[:, k] += step * response
            rest[:, k] -= step * response[place]
        raise FaceError(f"the potentials at {len(place)} vertices did not converge in {ITERATIONS} iterations")

    def _local_schur(self, place: NDArray[np.intp]) -> Operator:
        """Schur complement on `place` of the part of A near it."""
        a = self.poisson.matrix
        near = place
        for _ in range(RINGS):
            near = np.unique(a[:, near].indices)
        around = np.setdiff1d(near, place)
        on_pins, on_near = a[:, place], a[:, around]
        within, across = on_pins[place], on_near[place]
        if len(around) == 0:
            return lambda v: np.asarray(within @ v)
        solve = factorise(on_near[around].tocsc(), "auto")
        return lambda v: np.asarray(within @ v - across @ solve(across.T @ v))


def rim(mesh: CageMesh, joined: NDArray[np.intp]) -> NDArray[np.intp]:
    """Those of the vertices that join the conductor which have a neighbour that is not part of it.

    The others are shielded by the rest: no charge flows to them, and they take the conductor's potential by
    themselves.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> owner = np.array([-1, 0, 0, 0], dtype=np.int32)
    >>> tets = np.array([[0, 1, 2, 3]], dtype=np.int32)
    >>> mesh = CageMesh(corners, tets, owner, *3 * [np.zeros(4, dtype=bool)])
    >>> rim(mesh, np.array([0]))
    array([], dtype=int64)
    """
    inside = np.zeros(len(mesh.owner), dtype=np.bool_)
    inside[joined] = True
    return np.asarray(joined[_exposed(mesh.tets, inside, inside | (mesh.owner >= 0))[joined]])


@compiled()
def _exposed(tets: NDArray[np.int32], inside: NDArray[np.bool_], conducting: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether a vertex (m,) shares a tetrahedron of one of `inside` with one that does not conduct."""
    out = np.zeros(len(inside), dtype=np.bool_)
    for t in range(len(tets)):
        p, q, r, s = tets[t, 0], tets[t, 1], tets[t, 2], tets[t, 3]
        if (inside[p] or inside[q] or inside[r] or inside[s]) and not (
            conducting[p] and conducting[q] and conducting[r] and conducting[s]
        ):
            out[p] = out[q] = out[r] = out[s] = True
    return out
