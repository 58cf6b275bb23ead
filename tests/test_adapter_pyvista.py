"""The PyVista accessor."""

import subprocess
import sys

import numpy as np
import pytest

from face_plugin import Params, estimate_normals, reconstruct
from face_plugin.adapters import pyvista as adapter
from face_plugin.shapes import box, torus

pv = pytest.importorskip("pyvista", minversion="0.48")

SHAPE = torus(600)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_normals_become_the_active_ones_of_a_copy(dtype):
    cloud = pv.PolyData(SHAPE.points.astype(dtype))
    cloud.point_data["label"] = np.arange(600)
    result = cloud.face.estimate_normals(Params(seed=2))
    expected = estimate_normals(SHAPE.points.astype(dtype), Params(seed=2)).normals
    assert result.point_data.active_normals_name == "Normals"
    assert np.array_equal(result.point_data["Normals"], expected)
    assert result.point_data["Normals"].dtype == dtype
    assert np.array_equal(result.point_data["label"], np.arange(600))
    assert list(cloud.point_data) == ["label"]


def test_normals_in_place():
    grid = pv.PolyData(SHAPE.points).cast_to_unstructured_grid()
    assert grid.face.estimate_normals(inplace=True) is grid
    assert np.array_equal(grid.point_data["Normals"], estimate_normals(SHAPE.points).normals)


def test_a_surface_is_that_of_the_array_call():
    mesh = pv.PolyData(SHAPE.points).face.reconstruct(depth=5, filter_interior=False, backend="open3d")
    surface = reconstruct(SHAPE.points, depth=5, filter_interior=False, backend="open3d")
    assert np.array_equal(mesh.points, surface.vertices)
    assert np.array_equal(mesh.regular_faces, surface.faces)
    assert np.array_equal(mesh.point_data["densities"], surface.densities)
    assert mesh.is_all_triangles


def test_sensors_reach_normals_and_surface():
    room, views = box(600), [[0.1, 0.0, 0.0]]
    cloud = pv.PolyData(room.points)
    expected = estimate_normals(room.points, viewpoints=views).normals
    assert ((expected * room.normals).sum(axis=1) < 0).all()
    assert np.array_equal(cloud.face.estimate_normals(viewpoints=views).point_data["Normals"], expected)
    mesh = cloud.face.reconstruct(depth=5, backend="open3d", viewpoints=views)
    assert np.array_equal(mesh.points, reconstruct(room.points, depth=5, backend="open3d", viewpoints=views).vertices)


def test_the_accessor_is_there_at_first_use_without_an_import_of_ours():
    code = """
import sys
import pyvista
pyvista.PolyData([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]).face.estimate_normals
assert "face_plugin.adapters.pyvista" in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_registering_can_be_undone_and_repeated(recwarn):
    cloud = pv.PolyData(SHAPE.points)
    adapter.unregister()
    adapter.unregister()
    assert not hasattr(cloud, "face")
    assert adapter.register()
    assert adapter.register()
    assert hasattr(cloud, "face")
    assert not recwarn.list


def test_nothing_happens_where_pyvista_is_missing():
    code = """
import sys
sys.modules["pyvista"] = None  # what an import finds where it is not installed
from face_plugin.adapters import pyvista
assert pyvista.register() is False
pyvista.unregister()
"""
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_wrong_types_say_what_to_pass():
    with pytest.raises(TypeError, match=r"dataset must be a PyVista dataset, found ndarray: pass pyvista.PolyData"):
        adapter.FaceAccessor(SHAPE.points)
    with pytest.raises(TypeError, match=r"params must be a face_plugin.Params or None, found dict"):
        pv.PolyData(SHAPE.points).face.estimate_normals({"alpha": 0.1})
