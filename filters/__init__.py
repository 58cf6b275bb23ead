"""Steps of a filter chain, free of any host.

A step is a frozen dataclass that turns one `PointSet` into the next. Steps chain, and a chain can stand in a
file::

    from face_plugin.filters import Chain, Interior, Normals, PointSet, Reconstruct

    chain = Chain([Normals(), Interior(), Reconstruct(depth=9)])
    mesh = chain(PointSet(points)).surface
"""

from typing import Any

from face_plugin.filters.base import Filter
from face_plugin.filters.chain import Chain
from face_plugin.filters.interior import Interior
from face_plugin.filters.normals import Normals
from face_plugin.filters.pointset import PointSet
from face_plugin.filters.reconstruct import Reconstruct
from face_plugin.filters.sculpt import Sculpt
from face_plugin.filters.thin import Thin
from face_plugin.result import Mesh

__all__ = ["Chain", "Filter", "Interior", "Mesh", "Normals", "PointSet", "Reconstruct", "Sculpt", "Thin"]


def __getattr__(name: str) -> Any:
    """Give `Reconstruct` under the name that it had."""
    if name != "Surface":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import warnings

    warnings.warn(
        "face_plugin.filters.Surface is now face_plugin.filters.Reconstruct", DeprecationWarning, stacklevel=2
    )
    return Reconstruct
