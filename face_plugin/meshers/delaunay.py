"""Plain Delaunay mesher: nothing is constrained, because nothing needs to be.

The vertices of a ball's solid are cospherical and their sphere is empty, since balls are disjoint. So every Delaunay
tetrahedralisation of all vertices contains each solid; the tetrahedra inside it, those with four vertices of one
ball, are dropped. Free vertices from a graded octree take the place of quality refinement.
"""

from __future__ import annotations

import logging
import threading
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from face_plugin.cage import Balls
from face_plugin.domain import Box, Filling
from face_plugin.errors import MeshingError
from face_plugin.meshers import CageMesh

__all__ = ["delaunay_mesh"]

log = logging.getLogger(__name__)

# A tetrahedron flatter than this (volume by cubed longest edge) is rounding: four coplanar vertices of the box, or
# a sliver whose gradient would be noise.
FLATTEST = 1e-9
# Random displacement, as a fraction of the largest coordinate, that decides between the Delaunay tetrahedralisations of
# cospherical vertices. It is gmsh's own, whose generator is the C library's: another mesh at every call.
NUDGE = 1e-12

GMSH_LIBRARIES = "libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1 libfontconfig1"
_gmsh_lock = threading.Lock()


def delaunay_mesh(balls: Balls, filling: Filling, box: Box) -> CageMesh:
    """Mesh the box minus the balls by the Delaunay tetrahedralisation of all vertices.

    Parameters
    ----------
    balls : Balls
    filling : Filling
        Free vertices inside the box and vertices on it, the box's corners among them.
    box : Box

    Returns
    -------
    CageMesh

    Raises
    ------
    MeshingError
        The tetrahedra do not fill the box.

    Examples
    --------
    >>> from face_plugin.cage import build_balls
    >>> from face_plugin.domain import fill, padded_box
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> box = padded_box(balls, 0.1)
    >>> mesh = delaunay_mesh(balls, fill(balls, np.ones(3), box, grading=0.8, finest=1.5, seed=0), box)
    >>> mesh.tets.shape[1]
    4
    """
    count, solid = balls.vertices.shape[:2]
    vertices = np.concatenate([balls.vertices.reshape(-1, 3), filling.inner, filling.outer])
    owner = np.full(len(vertices), -1, dtype=np.int32)
    owner[: count * solid] = np.repeat(np.arange(count, dtype=np.int32), solid)
    tets = tetrahedralize(vertices)
    tets, volume = _oriented(vertices, tets)
    expected = float(np.prod(box.upper - box.lower))
    if not np.isclose(volume.sum(), expected, rtol=1e-6):
        raise MeshingError(
            f"the Delaunay tetrahedra fill {volume.sum() / expected:.6f} of the box; "
            "try a larger Params.cage_spacing, which removes points that nearly coincide"
        )
    first = owner[tets[:, 0]]
    inside = (first >= 0) & (owner[tets[:, 1:]] == first[:, None]).all(axis=1)
    boundary = np.zeros(len(vertices), dtype=np.bool_)
    boundary[len(vertices) - len(filling.outer) :] = True
    return CageMesh(vertices, tets[~inside], owner, boundary, box.lower, box.upper)


def tetrahedralize(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Delaunay tetrahedra (t, 4) of points (m, 3), of either orientation: by gmsh, or by SciPy where gmsh cannot load."""
    gmsh = _load_gmsh()
    if gmsh is None:
        from scipy.spatial import Delaunay

        return np.asarray(Delaunay(points, qhull_options="Qbb Qc Qz Q12").simplices, dtype=np.int32)
    reach = float(np.linalg.norm(np.abs(points).max(axis=0)))
    nudge = np.random.default_rng(0).uniform(0.0, NUDGE * reach, points.shape)
    with _gmsh_lock:
        factor = gmsh.option.getNumber("Mesh.RandomFactor3D")
        gmsh.option.setNumber("Mesh.RandomFactor3D", 0.0)
        try:
            flat, steiner = gmsh.algorithm.tetrahedralize((points + nudge).ravel())
        except Exception as error:
            raise MeshingError(f"gmsh failed to tetrahedralise {len(points)} vertices: {error}") from error
        finally:
            gmsh.option.setNumber("Mesh.RandomFactor3D", factor)
    if len(steiner):
        raise MeshingError(f"gmsh added {len(steiner) // 3} vertices of its own")
    return np.asarray(flat).reshape(-1, 4).astype(np.int32) - 1


@cache
def _load_gmsh() -> ModuleType | None:
    try:
        import gmsh

        if not gmsh.isInitialized():
            # interruptible=True would take SIGINT away from the user's program.
            gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
    except (ImportError, OSError) as error:
        log.warning(
            "gmsh cannot be loaded (%s): SciPy's Delaunay is used, about ten times slower. "
            "On Debian or Ubuntu: apt-get install %s",
            error,
            GMSH_LIBRARIES,
        )
        return None
    return gmsh  # type: ignore[no-any-return]


def _oriented(
    vertices: NDArray[np.float64], tets: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Tetrahedra turned positive, flat ones dropped, and their volumes (t,)."""
    corner = vertices[tets[:, 0]]
    edges = [vertices[tets[:, k]] - corner for k in (1, 2, 3)]
    volume = np.einsum("ij,ij->i", np.cross(edges[0], edges[1]), edges[2]) / 6
    longest = np.sqrt(np.max([np.einsum("ij,ij->i", e, e) for e in edges], axis=0))
    negative = volume < 0
    tets[negative] = tets[negative][:, [1, 0, 2, 3]]
    keep = np.abs(volume) > FLATTEST * longest**3
    return np.ascontiguousarray(tets[keep]), np.abs(volume[keep])
