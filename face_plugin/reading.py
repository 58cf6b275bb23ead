"""What one field says of a cloud: its normals, what is inside, and how sure that is, each found when asked for."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from face_plugin.faraday.gradient import FieldAtPoints, field_at_points
from face_plugin.faraday.isosurface import shielded
from face_plugin.faraday.solve import SolvedCage
from face_plugin.method import orient
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.params import Params
from face_plugin.sides import enclosure
from face_plugin.sides.belief import believed_stations
from face_plugin.sides.confidence import confidence, witness
from face_plugin.sides.nesting import Nesting, cavities
from face_plugin.sides.parts import borne_out, open_parts, parts, told_by
from face_plugin.sides.patches import Planes, planes_of
from face_plugin.sides.reach import Reach
from face_plugin.sides.sensors import Sensors
from face_plugin.sides.sheets import Sheets
from face_plugin.sides.sights import sights
from face_plugin.stages import Stage

__all__ = ["Reading"]

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Reading:
    """What one field says of a cloud, in the canonical frame; each answer is found when first asked for."""

    cage: SolvedCage
    around: Neighbourhood
    sheets: Sheets | None
    plane: NDArray[np.float64] | None
    params: Params
    strength: NDArray[np.float64]
    """(m,) E_max at the vertices of the mesh."""
    stage: Stage
    sensors: Sensors | None = None

    @cached_property
    def sights(self) -> NDArray[np.float64] | None:
        """Directions (m, 3) in which sensors saw the distinct points: those given, or those that density tells."""
        if self.sensors is not None:
            return sights(self.around, self.sensors, self.planes.lines)
        if not self.refines:
            return None
        found = believed_stations(
            self.around, planes=self.planes, difference=self.seen.difference, strength=self.seen.strength
        )
        return None if found is None else found[1]

    @property
    def refines(self) -> bool:
        """Whether the points refine what the field says, or sensors, of their normals."""
        by_points = self.params.angles != "field" or self.sensors is not None
        return by_points and not self.around.plane and self.plane is None

    @cached_property
    def seen(self) -> FieldAtPoints:
        """What the field says of the distinct points."""
        return field_at_points(self.cage.mesh, self.strength, self.cage.balls, self.around.points)

    @cached_property
    def reach(self) -> Reach:
        """Where free space gets to between the distinct points."""
        return Reach(self.around)

    @cached_property
    def planes(self) -> Planes:
        """Planes of the distinct points, which sights, stations and sides ask for."""
        return planes_of(self.around)

    @cached_property
    def as_solids(self) -> NDArray[np.float64]:
        """Normals of the distinct points (m, d), before bodies within others are read as cavities."""
        with self.stage("normals"):
            return orient(
                self.around,
                self.seen,
                self.params,
                plane=self.plane,
                sheets=self.sheets,
                sights=self.sights,
                reach=self.reach,
                planes=self.planes if self.refines else None,
            )

    @cached_property
    def nesting(self) -> Nesting | None:
        """Bodies within others, where they are cavities."""
        if self.params.nested == "solid":
            return None
        return cavities(self.around, self.as_solids, self.part, self.looked_at)

    @property
    def looked_at(self) -> NDArray[np.bool_] | None:
        """Which distinct points (m,) a sensor saw."""
        return None if self.sights is None else np.asarray(self.sights.any(axis=1))

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """Normals of the distinct points (m, d)."""
        if self.nesting is None:
            return self.as_solids
        return np.where(self.nesting.turned[:, None], -self.as_solids, self.as_solids)

    @cached_property
    def enclosed(self) -> NDArray[np.bool_]:
        """Which distinct points (m,) the others enclose."""
        found = enclosure.enclosed(self.around, self.normals, self.seen.strength)
        if self.looked_at is not None:
            # What a sensor saw does not lie inside anything.
            return found & ~self.looked_at
        if not self.around.plane and found.any() and self.reach.gets_among(found, self.normals):
            log.warning(
                "%d of %d points seem to lie inside, but free space gets to them: they are kept; "
                "if this was scanned from inside, give its viewpoints",
                found.sum(),
                len(found),
            )
            return np.zeros_like(found)
        return found

    @cached_property
    def agreement(self) -> NDArray[np.float64]:
        """How far (m,) field, or sensors, and points agree on the side of the normals."""
        # The field knows nothing of cavities.
        return confidence(self.around, witness(self.seen.votes, self.sights), self.as_solids)

    @property
    def confidence(self) -> NDArray[np.float64]:
        """Confidence (m,) in the side of the normals."""
        return self.agreement * borne_out(self.part, self.sides, self.as_solids, self.seen)

    @cached_property
    def part(self) -> NDArray[np.intp]:
        """Which connected part each distinct point (m,) belongs to."""
        return parts(self.around, self.as_solids)

    @cached_property
    def open(self) -> NDArray[np.bool_]:
        """Which distinct points (m,) are of parts that enclose nothing."""
        return open_parts(self.part, self.seen)

    @cached_property
    def sides(self) -> NDArray[np.uint8]:
        """What told the sides (m,) of the normals."""
        # A station that density tells may be the mirror image of the true one: what follows is chosen.
        known = None if self.sensors is None else self.looked_at
        return told_by(self.part, self.open, self.as_solids, self.seen, known)

    def threshold(self, alpha: float | str) -> float:
        """Alpha as a number, which "auto" derives from the leak of the cage."""
        return enclosure.threshold(alpha, lambda: self.seen.strength[self.enclosed])

    def interior(self, alpha: float | str) -> NDArray[np.bool_]:
        """Which distinct points (m,) lie inside the object."""
        level = self.threshold(alpha)
        with self.stage("interior"):
            # What alpha is derived from decides as well.
            inside = self.enclosed.copy() if alpha == "auto" else np.ones(len(self.around), dtype=np.bool_)
            if self.nesting is not None:
                inside &= ~self.nesting.inner
            if self.around.plane:
                # Each point has the field of the disc nearest to it: no isoline needs to be drawn.
                inside &= self.seen.strength < level
            elif inside.any():
                candidates = self.around.points[inside]
                inside[inside] = shielded(self.cage.mesh, self.strength, candidates, level, self.params.inside)
            return inside
