"""What sculpting does to a solved cage: where edits go, and the field with them (paper sections 3.1.2, 3.6).

A point charge carves: it is one more scenario, in which the vertex of the charge has a high potential, the
box is grounded and the cage floats; space that the charge lights up counts as outside. A cage point shields:
the vertices near it join the conductor. Nothing is meshed or factorised again, see `face_plugin.sculpt.pins`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from face_plugin.cloud import Cloud, as_points
from face_plugin.faraday.balls import Balls
from face_plugin.faraday.field import vertex_gradients
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.poisson import Poisson
from face_plugin.sculpt.pins import PinnedPoisson

__all__ = ["Edit", "Sculptor"]

Kind = Literal["charge", "cage"]

# Potential of a charge, in largest values on the box (paper section 3.1.2).
CHARGE = 5.0
# Reach of a cage point, as a fraction of the distance to the nearest input point (paper section 3.6).
REACH = 0.9
# A position this near to a vertex, as a fraction of its distance to the nearest ball, is that vertex.
SAME = 1e-6


@dataclass(frozen=True, eq=False)
class Edit:
    """A charge or a cage point, and where it went."""

    number: int
    """Counts the edits of one cage from 1; never used twice."""
    kind: Kind
    position: NDArray[np.float64]
    """(3,) where it was asked for, in the coordinates of the input."""
    radius: float | None
    """Reach of a cage point, in the unit of the input; None for a charge."""
    vertices: NDArray[np.intp]
    """(k,) vertices of the mesh: that of a charge, or those that joined the conductor."""
    places: NDArray[np.float64]
    """(k, 3) where these vertices are, in the coordinates of the input."""


class Sculptor:
    """The edits of one solved cage, and its field with them.

    Parameters
    ----------
    mesh : CageMesh
    poisson : Poisson
    balls : Balls
    cloud : Cloud
    potential : (m, 3) float64
        Potentials of the three basis fields without edits.
    strength : (m,) float64
        E_max without edits.
    strength_of : callable
        E_max (m,) of the external fields whose basis has the given potentials.

    Attributes
    ----------
    edits : dict of int to Edit
    potential : (m, 3) float64
        Potentials of the three basis fields with the cage points.
    strength : (m,) float64
        E_max over the external fields and the scenario of the charges.
    """

    def __init__(
        self,
        mesh: CageMesh,
        poisson: Poisson,
        balls: Balls,
        cloud: Cloud,
        potential: NDArray[np.float64],
        strength: NDArray[np.float64],
        strength_of: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    ) -> None:
        self.mesh, self.balls, self.cloud = mesh, balls, cloud
        self.edits: dict[int, Edit] = {}
        self._count = 0
        self._pinned = PinnedPoisson(poisson)
        self._free = poisson.free
        self._adjacent = poisson.matrix
        self._without_edits = potential
        self._strength_of = strength_of
        self._joined = np.empty(0, dtype=np.intp)
        self.potential = potential
        self.strength = self._external = strength

    def copy(self) -> Sculptor:
        """Return a sculptor with the same edits; what is added to either is not added to the other."""
        # An edit replaces what a sculptor holds and changes none of it.
        return copy.copy(self)

    def add_charges(self, positions: ArrayLike, level: float) -> tuple[Edit, ...]:
        """Put charges at the vertices nearest to positions (k, 3), outside the proxy where that is near.

        The proxy is the isosurface of E_max at `level`. A charge goes to the nearest free vertex; if the
        proxy encloses that one, to the nearest of its neighbours which it does not enclose; if it encloses
        these too, the position was meant to be inside, as that in a closed cavity is, and the charge stays at
        the nearest vertex.
        """
        local = self._checked(positions)
        made = []
        for position, at in zip(np.array(positions, dtype=np.float64), local, strict=True):
            vertex = self._snap(at, level)
            made.append(self._edit("charge", position, None, np.array([vertex])))
        return self._added(made)

    def add_cage_points(self, positions: ArrayLike, radius: ArrayLike | None) -> tuple[Edit, ...]:
        """Let the free vertices within `radius` of positions (k, 3), or else the nearest, join the cage."""
        local = self._checked(positions)
        scale = self.cloud.frame.scale
        nearest = self._points.query(local)[0]
        reach = _reach(radius, REACH * nearest * scale) / scale
        held = _vertices(self.edits, "charge")
        made = []
        for row, position in enumerate(np.array(positions, dtype=np.float64)):
            distance = np.linalg.norm(self.mesh.vertices[self._free] - local[row], axis=1)
            near = self._free[distance <= reach[row]]
            if len(near) == 0:
                # Away from the points the mesh is coarse.
                near = self._free[[np.argmin(distance)]]
            if np.isin(held, near).any():
                raise ValueError(
                    f"positions[{row}]: a charge lies where the conductor would grow, and would do nothing "
                    "there; remove it or use a smaller radius"
                )
            made.append(self._edit("cage", position, float(reach[row]) * scale, near))
        return self._added(made)

    def remove(self, numbers: Iterable[int]) -> None:
        """Take edits back.

        Raises
        ------
        ValueError
            There is no edit of that number; nothing is removed then.
        """
        numbers = set(numbers)
        if unknown := sorted(numbers - self.edits.keys()):
            raise ValueError(f"edits: there is no edit {unknown[0]}; there are {sorted(self.edits)}")
        self._update({number: edit for number, edit in self.edits.items() if number not in numbers})

    def _checked(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Positions in the canonical frame; those where no edit can be are refused."""
        array = as_points(positions, "positions")
        local = self.cloud.frame.to_unit(array)
        distance, ball = self._centres.query(local)
        for row, at in enumerate(local):
            where = f"positions[{row}] = {tuple(float(x) for x in array[row])}"
            if (at <= self.mesh.lower).any() or (at >= self.mesh.upper).any():
                raise ValueError(f"{where} lies on or outside the box, where the potential is given")
            if distance[row] <= self.balls.radii[ball[row]]:
                point = int(np.argmax(self.cloud.rows == self.balls.points[ball[row]]))
                raise ValueError(
                    f"{where} lies inside the conducting ball of point {point}, whose radius is "
                    f"{self.balls.radii[ball[row]] * self.cloud.frame.scale:g}"
                )
        return local

    def _snap(self, at: NDArray[np.float64], level: float) -> int:
        loose = np.setdiff1d(self._free, self._joined)
        if len(loose) == 0:
            raise ValueError("positions: every vertex of the mesh has joined the conductor")
        distance = np.linalg.norm(self.mesh.vertices[loose] - at, axis=1)
        nearest = int(loose[np.argmin(distance)])
        if self.strength[nearest] >= level or distance.min() < SAME * self._centres.query(at)[0]:
            return nearest
        # A neighbour is on the same side of a wall: no edge of the mesh passes between two balls of a dense
        # cage.
        column = int(np.searchsorted(self._free, nearest))
        start, stop = self._adjacent.indptr[column : column + 2]
        near = np.intersect1d(self._free[self._adjacent.indices[start:stop]], loose)
        near = near[self.strength[near] >= level]
        if len(near) == 0:
            return nearest
        return int(near[np.argmin(np.linalg.norm(self.mesh.vertices[near] - at, axis=1))])

    def _edit(
        self,
        kind: Kind,
        position: NDArray[np.float64],
        radius: float | None,
        vertices: NDArray[np.intp],
    ) -> Edit:
        self._count += 1
        places = self.cloud.frame.from_unit(self.mesh.vertices[vertices])
        return Edit(self._count, kind, position, radius, vertices, places)

    def _added(self, made: list[Edit]) -> tuple[Edit, ...]:
        self._update(self.edits | {edit.number: edit for edit in made})
        return tuple(made)

    def _update(self, edits: dict[int, Edit]) -> None:
        """Solve for what changed: cage points change every scenario, charges only their own."""
        joined, held = _vertices(edits, "cage"), _vertices(edits, "charge")
        potential, external = self.potential, self._external
        if not np.array_equal(joined, self._joined):
            potential = self._pinned.solve(self._without_edits, joined=joined)
            external = self._strength_of(potential)
        strength = external
        if len(held):
            largest = float(np.linalg.norm(self.mesh.vertices[self.mesh.boundary], axis=1).max())
            still = np.zeros((len(self.mesh.vertices), 1))
            charged = self._pinned.solve(still, joined=joined, held=held, value=CHARGE * largest)
            gradient = vertex_gradients(self.mesh, charged)[:, :, 0]
            strength = np.maximum(external, np.linalg.norm(gradient, axis=1))
        # Everything at once, at the end: nothing has changed where a solve failed.
        self.edits, self._joined = edits, joined
        self.potential, self._external, self.strength = potential, external, strength

    @cached_property
    def _points(self) -> cKDTree:
        return cKDTree(self.cloud.points)

    @cached_property
    def _centres(self) -> cKDTree:
        return cKDTree(self.balls.centres)


def _vertices(edits: dict[int, Edit], kind: Kind) -> NDArray[np.intp]:
    """Distinct vertices of all edits of a kind."""
    vertices = [edit.vertices for edit in edits.values() if edit.kind == kind]
    return np.unique(np.concatenate([np.empty(0, dtype=np.intp), *vertices]))


def _reach(radius: ArrayLike | None, derived: NDArray[np.float64]) -> NDArray[np.float64]:
    """One positive radius a position (k,), in the unit of the input; `derived` (k,) where none is given."""
    if radius is None:
        return derived
    given = np.asarray(radius, dtype=object)
    if given.shape not in ((), derived.shape):
        raise ValueError(f"radius must be one number or {len(derived)}, one a position; found shape {given.shape}")
    given = np.broadcast_to(given, derived.shape)
    missing = np.array([one is None for one in given], dtype=np.bool_)
    radii = np.where(missing, derived, 0.0)
    radii[~missing] = given[~missing].astype(np.float64)
    bad = ~missing & ~(np.isfinite(radii) & (radii > 0))
    if bad.any():
        raise ValueError(f"radius must be finite and > 0, found {radii[bad][0]}")
    return radii
