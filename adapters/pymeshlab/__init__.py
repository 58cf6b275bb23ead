"""PyMeshLab: filters with MeshLab's naming and conventions, in Python and in filter scripts.

As functions, or after `register` as methods of every ``MeshSet`` and by name::

    from face_plugin.adapters import pymeshlab as face

    face.compute_normal_by_faraday_cage(ms, cage_spacing=pymeshlab.PercentageValue(1))

    face.register()
    ms.compute_selection_by_faraday_interior(alpha=0.05)
    ms.apply_filter("generate_surface_reconstruction_faraday", depth=9)

Every filter works on the current layer, is recorded in the MeshSet's filter script, and takes the settings
of `face_plugin.Params` by their own names: numbers as numbers, choices as their name or index, lengths
(``cage_spacing``) as ``PercentageValue`` of the layer's diagonal or ``PureValue``. An ``alpha`` or
``cage_spacing`` of 0, the default, or ``"auto"`` means automatic. With ``flipflag`` normals point to what is seen from
``viewpos``, the names of MeshLab's own filter for point clouds. ``sculpt`` is the path of a file of charges and cage
points. Both are in the coordinates of the layer; for the reconstruction in those of the scene. Wrong parameters raise
what PyMeshLab raises for its own filters.
"""

from face_plugin.adapters.pymeshlab.calls import (
    compute_normal_by_faraday_cage,
    compute_scalar_by_faraday_strength,
    compute_selection_by_faraday_interior,
    generate_surface_reconstruction_faraday,
)
from face_plugin.adapters.pymeshlab.run import register, run_filter_script, unregister

__all__ = [
    "compute_normal_by_faraday_cage",
    "compute_scalar_by_faraday_strength",
    "compute_selection_by_faraday_interior",
    "generate_surface_reconstruction_faraday",
    "register",
    "run_filter_script",
    "unregister",
]
