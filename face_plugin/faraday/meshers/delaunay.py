"""Plain Delaunay mesher: nothing is constrained, because nothing needs to be.

The vertices of a ball's solid are cospherical and their sphere is empty, since balls are disjoint. So every
Delaunay tetrahedralisation of all vertices contains each solid; the tetrahedra inside it, those with four
vertices of one ball, are dropped. Free vertices from a graded octree take the place of quality refinement.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import MeshingError
from face_plugin.faraday.balls import Balls
from face_plugin.faraday.domain import Box, Filling
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.meshers.boundary import ball_volumes, oriented
from face_plugin.faraday.meshers.kept_signals import same_signals

__all__ = ["delaunay_mesh", "gmsh_loads", "tetrahedralize"]

log = logging.getLogger(__name__)

Library = Literal["gmsh", "scipy"]

# Tetrahedra whose height is rounding, relative to the box: four vertices of one of its faces, whose gradient
# would be noise. Needles between nearly coincident balls are far higher.
FLATTEST = 1e-14
# Random displacement, as a fraction of the largest coordinate, that decides between the Delaunay
# tetrahedralisations of cospherical vertices. It is gmsh's own, whose generator is the C library's: another
# mesh at every call.
NUDGE = 1e-12
# gmsh's number of its fastest algorithm (Marot et al. 2019), four times as fast as its default; on one core, as several
# are slower for so few vertices. It meshes all of the convex hull.
HXT = 10.0
# A ball's solid is in the mesh when the tetrahedra inside it have its volume, up to the rounding of a tiny
# ball.
BALL_TOLERANCE = 1e-3

ADVICE = "try a larger Params.cage_spacing, which removes points that nearly coincide, or another Params.seed"
_gmsh_lock = threading.Lock()


def delaunay_mesh(balls: Balls, filling: Filling, box: Box, library: Library | None = None) -> CageMesh:
    """Mesh the box minus the balls by the Delaunay tetrahedralisation of all vertices.

    Parameters
    ----------
    balls : Balls
    filling : Filling
        Free vertices inside the box and vertices on it, the box's corners among them.
    box : Box
    library : {"gmsh", "scipy"}, optional
        Who tetrahedralises; by default gmsh, or SciPy where gmsh cannot be loaded.

    Returns
    -------
    CageMesh

    Raises
    ------
    MeshingError
        The tetrahedra do not contain the solids of the balls.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> from face_plugin.faraday.domain import fill, padded_box
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> box = padded_box(balls, 0.1)
    >>> mesh = delaunay_mesh(balls, fill(balls, np.ones(3), box, grading=0.8, finest=1.5, seed=0), box)
    >>> mesh.tets.shape[1]
    4
    """
    count, solid = balls.vertices.shape[:2]
    dimension = balls.centres.shape[1]
    vertices = np.concatenate([balls.vertices.reshape(-1, dimension), filling.inner, filling.outer])
    owner = np.full(len(vertices), -1, dtype=np.int32)
    owner[: count * solid] = np.repeat(np.arange(count, dtype=np.int32), solid)
    flat = FLATTEST * float((box.upper - box.lower).max())
    tets, volume = oriented(vertices, tetrahedralize(vertices, library), flat)
    first = owner[tets[:, 0]]
    inside = (first >= 0) & (owner[tets[:, 1:]] == first[:, None]).all(axis=1)
    expected = ball_volumes(balls)
    found = np.bincount(first[inside], weights=volume[inside], minlength=count)
    lost = int(np.count_nonzero(np.abs(found - expected) > BALL_TOLERANCE * expected))
    if lost:
        raise MeshingError(f"the Delaunay tetrahedra cut through {lost} of {count} balls; {ADVICE}")
    boundary = np.zeros(len(vertices), dtype=np.bool_)
    boundary[len(vertices) - len(filling.outer) :] = True
    return CageMesh(vertices, tets[~inside], owner, boundary, box.lower, box.upper)


def tetrahedralize(points: NDArray[np.float64], library: Library | None = None) -> NDArray[np.int32]:
    """Delaunay tetrahedra (t, 4) of points (m, 3), of either orientation; triangles (t, 3) of points (m, 2).

    Parameters
    ----------
    points : (m, d) float64
    library : {"gmsh", "scipy"}, optional
        By default gmsh, or SciPy where gmsh cannot be loaded. In the plane it is SciPy.

    Raises
    ------
    MeshingError
        The library failed.

    Examples
    --------
    >>> tetrahedralize(np.random.default_rng(0).random((50, 3)), "scipy").shape[1]
    4
    """
    if library is None:
        library = "gmsh" if gmsh_loads() else "scipy"
    return _by_gmsh(points) if library == "gmsh" and points.shape[1] == 3 else _by_scipy(points)


def _by_scipy(points: NDArray[np.float64]) -> NDArray[np.int32]:
    from scipy.spatial import Delaunay, QhullError

    try:
        return np.asarray(Delaunay(points, qhull_options="Qbb Qc Qz Q12").simplices, dtype=np.int32)
    except QhullError as error:
        reason = str(error).splitlines()[0]
        raise MeshingError(f"SciPy failed to tetrahedralise {len(points)} vertices ({reason}); {ADVICE}") from error


def _by_gmsh(points: NDArray[np.float64]) -> NDArray[np.int32]:
    gmsh = _gmsh()
    if gmsh is None:
        raise MeshingError("gmsh cannot be loaded")
    reach = float(np.linalg.norm(np.abs(points).max(axis=0)))
    nudge = np.random.default_rng(0).uniform(0.0, NUDGE * reach, points.shape)
    with _gmsh_lock, _own_gmsh_state(gmsh):
        try:
            flat, steiner = gmsh.algorithm.tetrahedralize((points + nudge).ravel())
        except Exception as error:
            raise MeshingError(f"gmsh failed to tetrahedralise {len(points)} vertices ({error}); {ADVICE}") from error
    if len(steiner):
        raise MeshingError(f"gmsh added {len(steiner) // 3} vertices of its own; {ADVICE}")
    return np.asarray(flat).reshape(-1, 4).astype(np.int32) - 1


def gmsh_loads() -> bool:
    """Whether gmsh (extra ``gmsh``) is installed and can be loaded; it needs libraries of the system.

    Examples
    --------
    >>> isinstance(gmsh_loads(), bool)
    True
    """
    return _gmsh() is not None


@cache
def _gmsh() -> ModuleType | None:
    try:
        import gmsh
    except (ImportError, OSError) as error:
        log.info("gmsh cannot be loaded (%s): SciPy's Delaunay is used", error)
        return None
    return gmsh  # type: ignore[no-any-return]


@contextmanager
def _own_gmsh_state(gmsh: ModuleType) -> Iterator[None]:
    """Work in a model and with options of our own: gmsh is one global state, and the user may share it."""
    if not gmsh.isInitialized():
        # It would end the process on a closed pipe and on SIGTERM, where Python raises; interruptible, on SIGINT too.
        with same_signals():
            gmsh.initialize(interruptible=False)
    options = {"General.Terminal": 0.0, "Mesh.RandomFactor3D": 0.0, "Mesh.Algorithm3D": HXT, "General.NumThreads": 1.0}
    before = {name: gmsh.option.getNumber(name) for name in options}
    current = gmsh.model.getCurrent()
    gmsh.model.add("face-plugin")
    for name, value in options.items():
        gmsh.option.setNumber(name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.remove()
        gmsh.model.setCurrent(current)
