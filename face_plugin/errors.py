"""Exceptions of the package, and the one way in which optional packages are imported."""

from __future__ import annotations

import importlib
from types import ModuleType

__all__ = ["FaceError", "MeshingError", "MissingDependencyError", "require"]


class FaceError(Exception):
    """Base class of what goes wrong inside the package, as opposed to bad input (`ValueError`)."""


class MeshingError(FaceError, RuntimeError):
    """A mesher could not fill the space between the box and the balls."""


class MissingDependencyError(FaceError, ImportError):
    """An optional package is needed and is not installed, or cannot be loaded."""


def require(module: str, extra: str) -> ModuleType:
    """Import an optional package, or say how to install it.

    Parameters
    ----------
    module : str
        Name of the module to import, such as ``"open3d"``.
    extra : str
        Name of the extra of this package that installs it.

    Raises
    ------
    MissingDependencyError
        With the exact ``pip install`` line, or, where the package is installed but a system library is
        missing, with the loader's own message.

    Examples
    --------
    >>> require("json", extra="none").dumps([1])
    '[1]'
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.split(".")[0] != module.split(".")[0]:
            raise
        raise MissingDependencyError(
            f"{module} is needed here and is not installed: pip install 'face-plugin[{extra}]'"
        ) from error
    except (ImportError, OSError) as error:
        raise MissingDependencyError(
            f"{module} is installed but cannot be loaded ({error}): a system library may be missing; "
            "see the section 'System libraries' of the README"
        ) from error
