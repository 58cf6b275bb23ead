"""Globally consistent outward normals for unoriented point clouds, by Faraday cage estimation (FaCE).

Arrays in, arrays out::

    import face_plugin

    normals = face_plugin.estimate_normals(points).normals
    surface = face_plugin.reconstruct(points)

The hosts' own types are served by `face_plugin.adapters`, chains of steps by `face_plugin.filters`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from face_plugin.errors import FaceError, MeshingError, MissingDependencyError
    from face_plugin.estimate import estimate_normals, orient_normals, reconstruct
    from face_plugin.execution import Execution
    from face_plugin.params import Params
    from face_plugin.result import Result, Side, Surface
    from face_plugin.solver import FaCE

__version__ = "0.2.0"
__all__ = [
    "Execution",
    "FaCE",
    "FaceError",
    "MeshingError",
    "MissingDependencyError",
    "Params",
    "Result",
    "Side",
    "Surface",
    "estimate_normals",
    "orient_normals",
    "reconstruct",
]

_HOME = {
    "Execution": "execution",
    "FaCE": "solver",
    "FaceError": "errors",
    "MeshingError": "errors",
    "MissingDependencyError": "errors",
    "Params": "params",
    "Result": "result",
    "Side": "result",
    "Surface": "result",
    "estimate_normals": "estimate",
    "orient_normals": "estimate",
    "reconstruct": "estimate",
}


def __getattr__(name: str) -> Any:
    """Import the public names on first use: numba and SciPy take longer to load than many scripts to run."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
