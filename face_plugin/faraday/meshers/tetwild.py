"""fTetWild through PyTetWild: slow, and robust where a constrained mesher fails; a third opinion.

fTetWild may move surfaces within an envelope and cut their triangles, so it keeps no record of which vertex
came from where. The triangles left at the holes are the conductor's, and each belongs to the ball at whose
distance it lies.
"""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.errors import require
from face_plugin.faraday.balls import Balls
from face_plugin.faraday.domain import Box
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.meshers.boundary import boundary_surface, oriented
from face_plugin.faraday.meshers.native import native_mesh

__all__ = ["PRACTICAL_BALLS", "tetwild_mesh"]

log = logging.getLogger(__name__)

PRACTICAL_BALLS = 20_000
"""Beyond this number of balls a mesh takes over half a minute (docs/meshers.md)."""

# Length of the edges far from the balls, as a fraction of the box's diagonal.
EDGE_LENGTH = 0.05
# How far fTetWild may stray from a triangle, as a fraction of the box's diagonal. Its time grows with the
# inverse square (1e-4 takes 20 times as long); at 1e-3 balls down to a radius of 2e-4 survive, those of 3e-5
# do not.
ENVELOPE = 1e-3
# Tetrahedra whose height is rounding, relative to the box: on its faces fTetWild leaves some of 1e-13; the
# next are above 1e-6.
FLATTEST = 1e-11
# How far beyond a ball's sphere a vertex still lies on the ball, relative to its radius.
ON_BALL = 1e-3
ADVICE = "try Params.mesher='delaunay', or a Params.cage_spacing above the distance of points that nearly coincide"


def tetwild_mesh(balls: Balls, box: Box, *, memory: float) -> CageMesh:
    """Mesh the box minus the balls with fTetWild.

    Two runs differ a little: fTetWild shuffles its triangles with a generator that cannot be seeded.

    Parameters
    ----------
    balls : Balls
    box : Box
    memory : float
        Bytes that fTetWild may allocate.

    Returns
    -------
    CageMesh

    Raises
    ------
    MeshingError
        fTetWild crashed, ran out of memory, or lost a ball.
    MissingDependencyError
        The pytetwild package is not installed.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> from face_plugin.faraday.domain import padded_box
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> mesh = tetwild_mesh(balls, padded_box(balls, 0.1), memory=4e9)
    >>> sorted(set(mesh.owner.tolist()))
    [-1, 0, 1, 2]
    """
    require("pytetwild", extra="tetwild")
    if len(balls.radii) > PRACTICAL_BALLS:
        log.warning(
            "fTetWild takes over half a minute for %d balls (more than %d); a larger Params.cage_spacing makes fewer",
            len(balls.radii),
            PRACTICAL_BALLS,
        )
    settings: dict[str, NDArray[np.generic]] = {
        "edge_length": np.array(EDGE_LENGTH),
        "envelope": np.array(ENVELOPE),
        "optimize": np.array(False),
    }
    surface = boundary_surface(balls, box)
    made, vertices, boundary = native_mesh("tetwild", surface, box, settings, memory=memory, advice=ADVICE)
    flat = FLATTEST * float((box.upper - box.lower).max())
    tets, _ = oriented(vertices, made["tets"].astype(np.int32), flat)
    # On a face of the box, flat tetrahedra may have had vertices for themselves.
    used, place = np.unique(tets, return_inverse=True)
    vertices, boundary, tets = vertices[used], boundary[used], place.reshape(tets.shape).astype(np.int32)
    return CageMesh(vertices, tets, _owners(vertices, tets, boundary, balls), boundary, box.lower, box.upper)


def _owners(
    vertices: NDArray[np.float64], tets: NDArray[np.int32], boundary: NDArray[np.bool_], balls: Balls
) -> NDArray[np.int32]:
    """Ball (m,) of each vertex of triangles that one tetrahedron has alone and that are not on the box."""
    faces = np.sort(np.concatenate([np.delete(tets, k, axis=1) for k in range(4)]), axis=1)
    faces, count = np.unique(faces, axis=0, return_counts=True)
    open_faces = faces[count == 1]
    at_holes = open_faces[~boundary[open_faces].all(axis=1)]
    used = np.unique(at_holes)
    owner = np.full(len(vertices), -1, dtype=np.int32)
    # The balls are disjoint, so the ball that a vertex lies on is the one of the nearest centre, by distance
    # in radii.
    distance, near = cKDTree(balls.centres).query(vertices[used], k=min(8, len(balls.radii)))
    distance, near = distance.reshape(len(used), -1), near.reshape(len(used), -1)
    relative = distance / balls.radii[near]
    best = relative.argmin(axis=1)
    rows = np.arange(len(used))
    owner[used] = np.where(relative[rows, best] <= 1 + ON_BALL, near[rows, best], -1)
    return owner
