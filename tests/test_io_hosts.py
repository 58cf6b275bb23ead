"""Files of other programs: what Open3D, trimesh and PyMeshLab write is read, and what is written here they read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from face_plugin.io import read_cloud, write_cloud

o3d = pytest.importorskip("open3d", reason="Open3D is a host, not a part of the core")
pymeshlab = pytest.importorskip("pymeshlab", reason="PyMeshLab is a host, not a part of the core")

BALL = trimesh.creation.icosphere(subdivisions=2)
NORMALS = np.asarray(BALL.vertices)
POINTS = NORMALS + np.array([10.0, 20.0, 3.0])
RGB = np.random.default_rng(2).integers(0, 256, (len(POINTS), 3))
# STL and some text of the hosts have six digits.
TOLERANCE = 1e-4


def check(path: Path, *, colours: bool = True, normals: bool | None = True) -> None:
    """Hold what is read against the ball; PLY and PCD are then written anew and read by Open3D."""
    cloud = read_cloud(path)
    order = nearest(cloud.points)
    assert sorted(order) == list(range(len(POINTS)))
    if normals is not None:
        assert (cloud.normals is not None) == normals
    if cloud.normals is not None:
        unit = cloud.normals / np.linalg.norm(cloud.normals, axis=1, keepdims=True)
        np.testing.assert_allclose(unit, NORMALS[order], atol=0.02)
    turned = path.with_name(f"turned{path.suffix if path.suffix in ('.ply', '.pcd') else '.ply'}")
    write_cloud(turned, cloud, normals=-NORMALS[order])
    host = o3d.io.read_point_cloud(str(turned))
    order = nearest(np.asarray(host.points))
    np.testing.assert_allclose(np.asarray(host.normals), -NORMALS[order], atol=1e-6)
    assert host.has_colors() == colours
    if colours:
        np.testing.assert_allclose(np.asarray(host.colors), RGB[order] / 255, atol=1.01 / 255)


def nearest(points: NDArray[np.floating]) -> list[int]:
    distance = np.linalg.norm(points[:, None] - POINTS, axis=2)
    assert distance.min(axis=1).max() < TOLERANCE
    return distance.argmin(axis=1).tolist()


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".pts", ".xyz", ".xyzrgb", ".xyzn"])
@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("compressed", [False, True])
def test_clouds_of_open3d(tmp_path: Path, suffix: str, text: bool, compressed: bool) -> None:
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    cloud.normals = o3d.utility.Vector3dVector(NORMALS)
    cloud.colors = o3d.utility.Vector3dVector(RGB / 255)
    path = tmp_path / f"a{suffix}"
    assert o3d.io.write_point_cloud(str(path), cloud, write_ascii=text, compressed=compressed)
    check(path, colours=suffix not in (".xyz", ".xyzn"), normals=suffix in (".ply", ".pcd", ".xyzn"))


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off", ".stl"])
def test_meshes_of_open3d(tmp_path: Path, suffix: str) -> None:
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(POINTS), o3d.utility.Vector3iVector(BALL.faces))
    mesh.vertex_normals = o3d.utility.Vector3dVector(NORMALS)
    mesh.vertex_colors = o3d.utility.Vector3dVector(RGB / 255)
    mesh.compute_triangle_normals()
    assert o3d.io.write_triangle_mesh(str(tmp_path / f"a{suffix}"), mesh)
    check(tmp_path / f"a{suffix}", colours=suffix != ".stl", normals=suffix != ".stl")


@pytest.mark.parametrize("name", ["a.ply", "text.ply", "a.obj", "a.off", "a.stl"])
def test_meshes_of_trimesh(tmp_path: Path, name: str) -> None:
    mesh = trimesh.Trimesh(POINTS, BALL.faces, process=False)
    mesh.visual.vertex_colors = np.c_[RGB, np.full(len(RGB), 255)].astype(np.uint8)
    path = tmp_path / name
    if name == "text.ply":
        path.write_bytes(trimesh.exchange.ply.export_ply(mesh, encoding="ascii", vertex_normal=True))
    else:
        mesh.export(path)
    check(path, colours=path.suffix in (".ply", ".obj"), normals=None)
    if path.suffix == ".ply":
        again = trimesh.load_mesh(path.with_name("turned.ply"), process=False)
        np.testing.assert_array_equal(again.faces, BALL.faces)


@pytest.mark.parametrize("name", ["a.ply", "text.ply", "a.obj", "a.off", "a.stl", "a.e57"])
def test_meshes_of_pymeshlab(tmp_path: Path, name: str) -> None:
    if name.endswith(".e57"):
        pytest.importorskip("pye57", reason="E57 needs the extra e57")
    meshes = pymeshlab.MeshSet()
    colours = np.c_[RGB / 255, np.ones(len(RGB))]
    scalars = np.arange(len(RGB))
    meshes.add_mesh(
        pymeshlab.Mesh(POINTS, BALL.faces, v_normals_matrix=NORMALS, v_color_matrix=colours, v_scalar_array=scalars)
    )
    options = {"binary": name == "a.ply"} if name.endswith(".ply") else {}
    meshes.save_current_mesh(str(tmp_path / name), **options)
    check(tmp_path / name, colours=not name.endswith(".stl"), normals=None)
    if name.endswith(".ply"):
        again = pymeshlab.MeshSet()
        again.load_new_mesh(str(tmp_path / "turned.ply"))
        np.testing.assert_array_equal(again.current_mesh().face_matrix(), BALL.faces)
        np.testing.assert_array_equal(again.current_mesh().vertex_scalar_array(), scalars)
        np.testing.assert_allclose(again.current_mesh().vertex_normal_matrix(), -NORMALS, atol=1e-6)


def test_poses_of_e57(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57", reason="E57 needs the extra e57")
    turn = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])  # a quarter around z, as a quaternion
    stations = [np.array([1.0, 2.0, 3.0]), np.array([-4.0, 0.0, 9.0])]
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        for station in stations:
            x, y, z = ((POINTS - station)[:, [1, 0, 2]] * [1, -1, 1]).T
            channels = {f"color{name}": RGB[:, k].astype(np.uint8) for k, name in enumerate(("Red", "Green", "Blue"))}
            data = {"cartesianX": x, "cartesianY": y, "cartesianZ": z, **channels}
            file.write_scan_raw(
                {name: np.ascontiguousarray(values) for name, values in data.items()},
                rotation=turn,
                translation=station,
            )
    cloud = read_cloud(tmp_path / "a.e57")
    np.testing.assert_allclose(cloud.points, np.tile(POINTS, (2, 1)), atol=1e-9)
    np.testing.assert_array_equal(cloud.viewpoints, stations)
    np.testing.assert_array_equal(cloud.attributes["green"], np.tile(RGB[:, 1], 2))
    np.testing.assert_array_equal(cloud.attributes["scan"], np.repeat([0, 1], len(POINTS)))
    (tmp_path / "b.e57").write_bytes((tmp_path / "a.e57").read_bytes()[:3000])
    with pytest.raises(ValueError, match=r"b\.e57: not a readable E57 file"):
        read_cloud(tmp_path / "b.e57")
