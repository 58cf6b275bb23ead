"""Meshers fill the space between the box and the balls; every one returns a `CageMesh`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["CageMesh"]


@dataclass(frozen=True)
class CageMesh:
    """Tetrahedral mesh of the box minus the balls; in the plane a mesh of triangles.

    Coordinates are those of the canonical frame (see `face_plugin.cloud`).
    """

    vertices: NDArray[np.float64]
    """(m, d) vertices; d is 3, or 2 in the plane."""
    tets: NDArray[np.int32]
    """(t, d + 1) tetrahedra or triangles, positively oriented; none lies inside a ball."""
    owner: NDArray[np.int32]
    """(m,) index of the ball that a vertex belongs to, -1 where it belongs to none."""
    boundary: NDArray[np.bool_]
    """(m,) whether a vertex lies on the box."""
    lower: NDArray[np.float64]
    """(d,) lower corner of the box."""
    upper: NDArray[np.float64]
    """(d,) upper corner of the box."""
