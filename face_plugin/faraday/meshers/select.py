"""Choose the mesher, keep from it what it cannot mesh, and check what it made."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import MeshingError, MissingDependencyError
from face_plugin.execution import allowed_memory
from face_plugin.faraday.balls import Balls
from face_plugin.faraday.domain import Box, fill
from face_plugin.faraday.meshers import CageMesh, gate
from face_plugin.faraday.meshers.delaunay import Library, delaunay_mesh, gmsh_loads
from face_plugin.faraday.meshers.tetgen import tetgen_mesh
from face_plugin.faraday.meshers.tetwild import PRACTICAL_BALLS, tetwild_mesh
from face_plugin.params import Params

__all__ = ["build_mesh"]

log = logging.getLogger(__name__)

# Measured (docs/meshers.md): bytes a vertex of the mesh for Delaunay, bytes a vertex of the balls for the
# others, which place the free vertices themselves.
VERTEX_BYTES: dict[Library, float] = {"gmsh": 2000.0, "scipy": 3000.0}
TETGEN_BYTES = 10e3
TETWILD_BYTES = 3e3


@dataclass(frozen=True)
class _Mesher:
    """A way to make the mesh, and what the balls must keep for it (see `gate.check_balls`)."""

    make: Callable[[Balls, NDArray[np.float64], Box, Params, float], CageMesh]
    smallest: float
    gap: float
    clearance: float


def _check_memory(balls: Balls, vertex_bytes: float, memory: float) -> float:
    """Bytes that the vertices of the balls will take; raise where that is more than `memory`."""
    count, solid = balls.vertices.shape[:2]
    taken = float(count * solid * vertex_bytes)
    gate.check_memory(taken, memory, f"a mesh around {count} balls of {solid} vertices")
    return taken


def _delaunay(library: Library) -> _Mesher:
    def make(balls: Balls, spacing: NDArray[np.float64], box: Box, params: Params, memory: float) -> CageMesh:
        taken = _check_memory(balls, VERTEX_BYTES[library], memory)
        filling = fill(
            balls,
            spacing,
            box,
            grading=params.grading,
            finest=params.finest,
            seed=params.seed,
            most=(memory - taken) / VERTEX_BYTES[library],
        )
        return delaunay_mesh(balls, filling, box, library)

    return _Mesher(make, smallest=2e-11, gap=0.0, clearance=1e-10)


def _tetgen(balls: Balls, spacing: NDArray[np.float64], box: Box, params: Params, memory: float) -> CageMesh:
    _check_memory(balls, TETGEN_BYTES, memory)
    return tetgen_mesh(balls, box, memory=memory)


def _tetwild(balls: Balls, spacing: NDArray[np.float64], box: Box, params: Params, memory: float) -> CageMesh:
    _check_memory(balls, TETWILD_BYTES, memory)
    return tetwild_mesh(balls, box, memory=memory)


MESHERS = {
    "gmsh": _delaunay("gmsh"),
    "scipy": _delaunay("scipy"),
    "tetgen": _Mesher(_tetgen, smallest=1e-9, gap=1e-12, clearance=1e-9),
    "tetwild": _Mesher(_tetwild, smallest=1e-4, gap=1e-9, clearance=1e-9),
}


def build_mesh(
    balls: Balls, spacing: NDArray[np.float64], box: Box, params: Params, memory: float | None = None
) -> CageMesh:
    """Mesh the box minus the balls with the mesher that `params` names.

    Parameters
    ----------
    balls : Balls
    spacing : (b,) float64
        Local spacing at each ball.
    box : Box
    params : Params
        Its `mesher`, `grading`, `finest` and `seed`. ``mesher="auto"`` is Delaunay by gmsh; where that fails, by
        SciPy; where that fails too, fTetWild if it is installed and the balls are few. It says so in the log.
    memory : float, optional
        Bytes that meshing may take, by default all that are free.

    Returns
    -------
    CageMesh

    Raises
    ------
    MeshingError
        The balls cannot be meshed, or the mesher failed; the message says what to try.
    MissingDependencyError
        The mesher named is not installed.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> from face_plugin.faraday.domain import padded_box
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> build_mesh(balls, np.ones(3), padded_box(balls, 0.1), Params()).vertices.shape[1]
    3
    """
    failures = []
    flat = balls.centres.shape[1] == 2
    for name in _in_plane(params.mesher) if flat else _candidates(params.mesher, len(balls.radii)):
        mesher = MESHERS[name]
        try:
            gate.check_balls(balls, spacing, box, smallest=mesher.smallest, gap=mesher.gap, clearance=mesher.clearance)
            mesh = mesher.make(balls, spacing, box, params, allowed_memory(memory))
            gate.check_mesh(mesh, balls, box, advice="try another Params.mesher or a larger Params.cage_spacing")
        except MeshingError as error:
            failures.append(f"{name}: {error}")
            if params.mesher == "auto":
                log.warning("the mesher %s failed: %s", name, error)
        except MissingDependencyError as error:
            if params.mesher != "auto":
                raise
            failures.append(f"{name}: {error}")
        else:
            if failures:
                log.warning("the mesh was made by %s instead", name)
            return mesh
    raise MeshingError("; ".join(failures))


def _in_plane(mesher: str) -> list[str]:
    """Meshers to try in the plane: the others make tetrahedra."""
    if mesher not in ("auto", "delaunay"):
        raise ValueError(f"mesher must be 'auto' or 'delaunay' for points in the plane, found {mesher!r}")
    return ["scipy"]


def _candidates(mesher: str, count: int) -> list[str]:
    """Meshers to try, in order."""
    delaunay = ["gmsh"] if gmsh_loads() else ["scipy"]
    if mesher == "delaunay":
        return delaunay
    if mesher != "auto":
        return [mesher]
    few = count <= PRACTICAL_BALLS
    return list(dict.fromkeys([*delaunay, "scipy", *(["tetwild"] if few else [])]))
