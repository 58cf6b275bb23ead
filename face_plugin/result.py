"""What is said of a cloud: its normals, and its surface."""

from __future__ import annotations

import enum
import logging
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import FaceError
from face_plugin.params import Params

__all__ = ["Mesh", "Result", "Side", "Surface", "kept_points"]

log = logging.getLogger(__name__)

# Share of points left out that is no longer a matter of course.
MANY = 0.25
# Fewest points that a surface is made from.
FEWEST = 4


class Side(enum.IntEnum):
    """What told the side of normals: a value of `Result.sides`.

    Examples
    --------
    >>> sides = np.array([1, 1, 0], dtype=np.uint8)
    >>> sides == Side.FIELD
    array([ True,  True, False])
    >>> Side(sides[2]).name
    'CHOSEN'
    """

    CHOSEN = 0
    """Nothing: an open part that no sensor saw. Its normals are on one side; which one is a guess."""
    FIELD = 1
    """The field: the part encloses something, and its normals point away from that."""
    SENSORS = 2
    """Sensors saw the part, and its normals face them."""

    @staticmethod
    def count(sides: NDArray[np.uint8]) -> dict[str, int]:
        """How many of the points (n,) have each side: by name, in lower case."""
        return {side.name.lower(): int(np.count_nonzero(sides == side)) for side in Side}


@dataclass(frozen=True)
class Result:
    """What the method says of each input point, in the order of the input."""

    normals: NDArray[np.floating]
    """(n, 3) outward unit normals, in the input's floating-point type; (n, 2) in the plane."""
    strength: NDArray[np.floating]
    """(n,) E_max at the point's ball; unshielded space has 1."""
    confidence: NDArray[np.floating]
    """(n,) confidence in the side of the normal, in [0, 1]: the agreement of field, or sensors, and points, times the
    jump of the winding number across the point; see `face_plugin.sides.confidence`. Where the side was chosen, times
    what the field says for it, which is next to nothing."""
    interior: NDArray[np.bool_] | None
    """(n,) whether the point lies inside the object; None where it was not asked for."""
    timings: dict[str, float]
    """Seconds by stage."""
    params: Params
    """The settings as resolved."""
    strays: NDArray[np.bool_]
    """(n,) whether the point lies too far from everything to belong to a surface; its confidence is 0, and its normal
    that of the nearest point that is none."""
    open: NDArray[np.bool_]
    """(n,) whether the point is of an open part of the cloud, one that encloses nothing, such as a floor: the field is
    alike on both of its sides. Connected points have the same value."""
    sides: NDArray[np.uint8]
    """(n,) what told the side of the normal: 0 nothing, so that it was chosen, 1 the field, 2 sensors; see `Side`.
    Connected points have the same value."""

    @property
    def kept(self) -> NDArray[np.bool_]:
        """(n,) the points that a surface is made from: neither strays nor interior."""
        return ~self.strays if self.interior is None else ~(self.strays | self.interior)


def kept_points(result: Result) -> NDArray[np.bool_]:
    """Points (n,) that a surface is made from; many left out are told, and hardly any left is an error.

    Raises
    ------
    FaceError
        Fewer than four points are kept.
    """
    kept = result.kept
    count, strays = len(kept), int(result.strays.sum())
    interior = 0 if result.interior is None else int(result.interior.sum())
    found = f"{interior} of {count} points as interior and {strays} as strays"
    if np.count_nonzero(kept) < FEWEST:
        raise FaceError(f"nothing is left to make a surface from: found {found}; try filter_interior=False")
    if np.count_nonzero(~kept) > MANY * count:
        log.warning(
            "%s are left out of the surface: is this a scan from inside (give its viewpoints), or are most points "
            "strays? filter_interior=False keeps all",
            found,
        )
    return kept


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of a reconstructed surface."""

    vertices: NDArray[np.float64]
    """(k, 3) in the unit of the points."""
    faces: NDArray[np.int64]
    """(f, 3) oriented outward."""
    densities: NDArray[np.float64] | None = None
    """(k,) sampling density at the vertices, where the host gives it."""


@dataclass(frozen=True, eq=False)
class Surface(Mesh):
    """A reconstructed surface, and what it was made from."""

    result: Result = field(kw_only=True)
    """The normals, and which points were kept."""
