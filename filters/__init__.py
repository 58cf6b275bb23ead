"""Steps of a filter chain, free of any host.

A step is a frozen dataclass that turns one `PointSet` into the next. Steps chain, and a chain can stand in a
file::

    from face_plugin.filters import Chain, Interior, Normals, PointSet, Surface

    chain = Chain([Normals(), Interior(), Surface(depth=9)])
    mesh = chain(PointSet(points)).surface
"""

from face_plugin.filters.base import Filter
from face_plugin.filters.chain import Chain
from face_plugin.filters.interior import Interior
from face_plugin.filters.normals import Normals
from face_plugin.filters.pointset import Mesh, PointSet
from face_plugin.filters.sculpt import Sculpt
from face_plugin.filters.surface import Surface
from face_plugin.filters.thin import Thin

__all__ = ["Chain", "Filter", "Interior", "Mesh", "Normals", "PointSet", "Sculpt", "Surface", "Thin"]
