"""Our filters as functions of a MeshSet."""

from __future__ import annotations

from typing import Any

from face_plugin.adapters.pymeshlab.filters import apply_by_name

__all__ = [
    "compute_normal_by_faraday_cage",
    "compute_scalar_by_faraday_strength",
    "compute_selection_by_faraday_interior",
    "generate_surface_reconstruction_faraday",
]


def compute_normal_by_faraday_cage(ms: Any, **parameters: Any) -> None:
    """Give the vertices of the current layer outward unit normals.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    onselected : bool
        Change the normals of the selected vertices only; all of them conduct.
    flipflag, viewpos : bool, (3,) array_like
        Whether normals point to what is seen from a viewpoint, and where that is.
    alpha, cage_spacing, ...
        Settings of `face_plugin.Params` and `face_plugin.Execution`.

    Examples
    --------
    >>> import pymeshlab
    >>> from face_plugin.shapes import sphere
    >>> ms = pymeshlab.MeshSet()
    >>> ms.add_mesh(pymeshlab.Mesh(sphere(300).points))
    >>> compute_normal_by_faraday_cage(ms, cage_spacing=pymeshlab.PercentageValue(1))
    >>> ms.current_mesh().vertex_normal_matrix().shape
    (300, 3)
    """
    apply_by_name(ms, "compute_normal_by_faraday_cage", parameters)


def compute_selection_by_faraday_interior(ms: Any, **parameters: Any) -> None:
    """Select the vertices inside the object and no others.

    MeshLab's own ``meshing_remove_selected_vertices`` deletes them.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    alpha, cage_spacing, ...
        Settings of `face_plugin.Params` and `face_plugin.Execution`.

    Examples
    --------
    >>> import pymeshlab
    >>> from face_plugin.shapes import sphere
    >>> ms = pymeshlab.MeshSet()
    >>> ms.add_mesh(pymeshlab.Mesh(sphere(300).points))
    >>> compute_selection_by_faraday_interior(ms)
    >>> ms.current_mesh().selected_vertex_number()
    0
    """
    apply_by_name(ms, "compute_selection_by_faraday_interior", parameters)


def compute_scalar_by_faraday_strength(ms: Any, **parameters: Any) -> None:
    """Make the field strength at the vertices their scalar: 1 in unshielded space, near 0 deep inside.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    onselected : bool
        Change the scalars of the selected vertices only.
    cage_spacing, ...
        Settings of `face_plugin.Params` and `face_plugin.Execution`.

    Examples
    --------
    >>> import pymeshlab
    >>> from face_plugin.shapes import sphere
    >>> ms = pymeshlab.MeshSet()
    >>> ms.add_mesh(pymeshlab.Mesh(sphere(300).points))
    >>> compute_scalar_by_faraday_strength(ms)
    >>> ms.current_mesh().has_vertex_scalar()
    True
    """
    apply_by_name(ms, "compute_scalar_by_faraday_strength", parameters)


def generate_surface_reconstruction_faraday(ms: Any, **parameters: Any) -> None:
    """Reconstruct a surface from the vertices of the current layer, as a new layer, which becomes current.

    As with MeshLab's Poisson reconstruction, the new layer has the transform of the old one applied.
    Normals of the old layer are neither used nor changed.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    depth, screened, filter_interior
        As in `face_plugin.reconstruct`.
    trim_distance : float
        The same; 0 for "auto", -1 for None.
    alpha, cage_spacing, ...
        Settings of `face_plugin.Params` and `face_plugin.Execution`.

    Examples
    --------
    >>> import pymeshlab
    >>> from face_plugin.shapes import sphere
    >>> ms = pymeshlab.MeshSet()
    >>> ms.add_mesh(pymeshlab.Mesh(sphere(300).points))
    >>> generate_surface_reconstruction_faraday(ms, depth=5)
    >>> ms.current_mesh().label()
    'Faraday mesh'
    """
    apply_by_name(ms, "generate_surface_reconstruction_faraday", parameters)
