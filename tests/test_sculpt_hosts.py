"""A sculpt file in Open3D and PyMeshLab: the figures of the array call."""

import numpy as np
import pytest

from face_plugin import estimate_normals, reconstruct
from face_plugin.sculpt import SculptFile
from face_plugin.shapes import spherical_shell

SHELL = spherical_shell(900)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "cavity.json"
    SculptFile(charges=((0.0, 0.0, 0.0),)).save(path)
    return path


@pytest.fixture
def outside(tmp_path):
    path = tmp_path / "outside.json"
    SculptFile(charges=((0.0, 0.0, 0.0), (9.0, 0.0, 0.0))).save(path)
    return path


def share(normals):
    return float((np.einsum("ij,ij->i", normals, SHELL.normals) > 0).mean())


def test_open3d(file, outside):
    o3d = pytest.importorskip("open3d")
    from face_plugin.adapters import open3d as face

    pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(SHELL.points))
    face.estimate_normals(pcd)
    assert share(np.asarray(pcd.normals)) < 0.9
    face.estimate_normals(pcd, sculpt=file)
    expected = estimate_normals(SHELL.points, sculpt=file, filter_interior=True)
    np.testing.assert_array_equal(np.asarray(pcd.normals), expected.normals)
    assert share(expected.normals) > 0.98
    _, index = face.remove_interior_points(pcd, sculpt=file)
    np.testing.assert_array_equal(index, np.flatnonzero(~expected.interior))
    mesh, _ = face.create_from_point_cloud_face(pcd, 5, sculpt=file)
    surface = reconstruct(SHELL.points, depth=5, sculpt=file, backend="open3d")
    np.testing.assert_array_equal(np.asarray(mesh.vertices), surface.vertices)
    with pytest.raises(ValueError, match=r"outside.json: charges: positions\[1\] .* outside the box"):
        face.estimate_normals(pcd, sculpt=outside)


def test_pymeshlab(file, outside, tmp_path):
    ml = pytest.importorskip("pymeshlab")
    from face_plugin.adapters import pymeshlab as face

    def cloud():
        ms = ml.MeshSet()
        ms.add_mesh(ml.Mesh(SHELL.points))
        return ms

    ms = cloud()
    face.compute_normal_by_faraday_cage(ms, sculpt=str(file))
    expected = estimate_normals(SHELL.points, sculpt=file, filter_interior=True)
    np.testing.assert_allclose(ms.current_mesh().vertex_normal_matrix(), expected.normals, atol=1e-12)
    face.compute_selection_by_faraday_interior(ms, sculpt=str(file))
    np.testing.assert_array_equal(ms.current_mesh().vertex_selection_array(), expected.interior)
    # The script that MeshLab saves has the file in it, and runs again.
    ms.save_filter_script(str(tmp_path / "saved.mlx"))
    again = cloud()
    face.run_filter_script(again, tmp_path / "saved.mlx")
    np.testing.assert_allclose(again.current_mesh().vertex_normal_matrix(), expected.normals, atol=1e-12)
    face.generate_surface_reconstruction_faraday(ms, depth=5, sculpt=str(file))
    surface = reconstruct(SHELL.points, depth=5, sculpt=file, backend="pymeshlab")
    assert ms.current_mesh().vertex_number() == len(surface.vertices)
    for wrong, message in ((outside, "outside.json: charges"), (tmp_path / "none.json", "No such file")):
        with pytest.raises(ml.PyMeshLabException, match=message):
            face.compute_normal_by_faraday_cage(ms, sculpt=str(wrong))
