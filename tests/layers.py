"""A layer of PyMeshLab that has all that a layer can have."""

import numpy as np
import pytest

from face_plugin.shapes import torus

ml = pytest.importorskip("pymeshlab")


SHAPE = torus(600)


NAMES = (
    "compute_normal_by_faraday_cage",
    "compute_selection_by_faraday_interior",
    "compute_scalar_by_faraday_strength",
    "generate_surface_reconstruction_faraday",
)


def layer(points=SHAPE.points, *, turned=False):
    """Two layers, of which the first is current and has all that a layer can have."""
    ms = ml.MeshSet()
    colours = np.tile([0.25, 0.5, 0.75, 1.0], (len(points), 1))
    numbers = np.arange(len(points), dtype=float)
    ms.add_mesh(ml.Mesh(points, v_scalar_array=numbers, v_color_matrix=colours), "scan")
    ms.add_mesh(ml.Mesh(points[:10]), "other")
    ms.set_current_mesh(0)
    mesh = ms.current_mesh()
    mesh.add_vertex_custom_scalar_attribute(numbers, "label")
    mesh.add_vertex_custom_point_attribute(points[:, ::-1].copy(), "flow")
    ms.compute_selection_by_condition_per_vertex(condselect="vi < 250")
    if turned:
        ms.compute_matrix_from_rotation(angle=33, rotaxis="X axis", freeze=False)
        ms.compute_matrix_from_translation(axisx=5, freeze=False)
    return ms
