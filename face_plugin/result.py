"""What is said of a cloud: its normals, and its surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.params import Params

__all__ = ["Result", "Surface"]


@dataclass(frozen=True)
class Result:
    """What the method says of each input point, in the order of the input."""

    normals: NDArray[np.floating]
    """(n, 3) outward unit normals, in the input's floating-point type."""
    strength: NDArray[np.floating]
    """(n,) E_max at the point's ball; unshielded space has 1."""
    confidence: NDArray[np.floating]
    """(n,) confidence in the side of the normal, in [0, 1]: the agreement of field and points, times the jump of the
    winding number across the point; see `face_plugin.sides.confidence`."""
    interior: NDArray[np.bool_] | None
    """(n,) whether the point lies inside the object; None where it was not asked for."""
    timings: dict[str, float]
    """Seconds by stage."""
    params: Params
    """The settings as resolved."""


@dataclass(frozen=True)
class Surface:
    """A reconstructed surface."""

    vertices: NDArray[np.float64]
    """(k, 3) in the unit of the input."""
    faces: NDArray[np.int64]
    """(f, 3) oriented outward."""
    densities: NDArray[np.float64] | None
    """(k,) sampling density at the vertices, where the host gives it."""
    result: Result
    """The normals, and the points kept, that it was made from."""
