"""The paper's own discretisation: TetGen on the box with the balls' solids as constrained facets and holes.

Paper section 3.1 and the authors' code: the solids are holes, radius-edge ratio 1.414, no tetrahedron larger
than 0.001 of the box. TetGen may put vertices of its own on the facets; on a ball they belong to the
conductor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import require
from face_plugin.faraday.balls import Balls
from face_plugin.faraday.domain import Box
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.meshers.boundary import boundary_surface, oriented
from face_plugin.faraday.meshers.native import native_mesh

__all__ = ["tetgen_mesh"]

RADIUS_EDGE_RATIO = 1.414
LARGEST_SHARE = 0.001
ADVICE = (
    "try Params.mesher='delaunay', which has no facets that could intersect, a smaller Params.ball_radius, "
    "or a Params.cage_spacing above the distance of the points that nearly coincide"
)


def tetgen_mesh(balls: Balls, box: Box, *, memory: float) -> CageMesh:
    """Mesh the box minus the balls with TetGen, as the paper does.

    Parameters
    ----------
    balls : Balls
    box : Box
    memory : float
        Bytes that TetGen may allocate.

    Returns
    -------
    CageMesh

    Raises
    ------
    MeshingError
        TetGen crashed, ran out of memory, or refused the facets.
    MissingDependencyError
        The tetgen package is not installed.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> from face_plugin.faraday.domain import padded_box
    >>> balls = build_balls(np.eye(3), np.arange(3), solid="icosahedron")
    >>> mesh = tetgen_mesh(balls, padded_box(balls, 0.1), memory=1e9)
    >>> int((mesh.owner >= 0).sum()) >= 36
    True
    """
    require("tetgen", extra="tetgen")
    surface = boundary_surface(balls, box)
    largest = LARGEST_SHARE * float(np.prod(box.upper - box.lower))
    settings: dict[str, NDArray[np.generic]] = {
        # TetGen keeps 0 for facets without a marker: the box is 1, the balls count from 2.
        "markers": surface.owner + np.int32(2),
        "holes": balls.centres,
        "switches": np.array(f"pq{RADIUS_EDGE_RATIO}a{largest:.17g}Q"),
    }
    made, vertices, boundary = native_mesh("tetgen", surface, box, settings, memory=memory, advice=ADVICE)
    tets, _ = oriented(vertices, made["tets"].astype(np.int32), flat=0.0)
    owner = np.full(len(vertices), -1, dtype=np.int32)
    markers = made["markers"].ravel().astype(np.int32)
    faces = made["faces"].astype(np.int64)
    on_ball = markers >= 2
    owner[faces[on_ball]] = (markers[on_ball] - 2)[:, None]
    return CageMesh(vertices, tets, owner, boundary, box.lower, box.upper)
