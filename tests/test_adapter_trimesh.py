"""trimesh geometries where arrays of points are taken."""

import numpy as np
import pytest

from face_plugin import Params, estimate_normals, reconstruct
from face_plugin.adapters import trimesh as adapter
from face_plugin.shapes import box, sphere, torus

trimesh = pytest.importorskip("trimesh")

SHAPE = torus(600)


def test_a_point_cloud_a_mesh_and_an_array_are_the_same_points():
    faces = np.arange(600).reshape(200, 3)
    expected = estimate_normals(SHAPE.points, Params(seed=2), filter_interior=False)
    for geometry in (
        trimesh.PointCloud(SHAPE.points),
        trimesh.Trimesh(SHAPE.points, faces, process=False),
        SHAPE.points,
    ):
        result = adapter.estimate_normals(geometry, Params(seed=2))
        assert np.array_equal(result.normals, expected.normals)
        assert np.array_equal(result.strength, expected.strength)


def test_a_surface_is_a_trimesh():
    options = {"depth": 5, "filter_interior": False, "backend": "open3d"}
    mesh = adapter.reconstruct(trimesh.PointCloud(SHAPE.points), **options)
    surface = reconstruct(SHAPE.points, **options)
    assert np.array_equal(mesh.vertices, surface.vertices)
    assert np.array_equal(mesh.faces, surface.faces)
    assert np.array_equal(mesh.vertex_attributes["densities"], surface.densities)
    assert mesh.is_watertight
    # The torus of the generator: 2 pi^2 R r^2 with R = 1 and r = 0.4; an octree of depth 5 has cells of 0.1.
    assert mesh.volume == pytest.approx(2 * np.pi**2 * 0.16, rel=0.05)


def test_a_scene_is_all_its_geometries_in_its_own_frame():
    ball = sphere(300)
    scene = trimesh.Scene([trimesh.PointCloud(ball.points)])
    scene.add_geometry(trimesh.PointCloud(ball.points), transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    points = adapter.points_of(scene)
    assert np.allclose(points, np.concatenate([ball.points, ball.points + np.array([5.0, 0.0, 0.0])]))
    assert np.array_equal(adapter.estimate_normals(scene).normals, estimate_normals(points).normals)
    with pytest.raises(ValueError, match="the scene must hold a geometry with points"):
        adapter.points_of(trimesh.Scene())


def test_points_in_the_plane_are_refused():
    with pytest.raises(ValueError, match=r"points must have the shape \(n, 3\), found \(50, 2\)"):
        adapter.estimate_normals(np.random.default_rng(0).random((50, 2)))


def test_sensors_are_passed_on():
    room = box(600)
    result = adapter.estimate_normals(trimesh.PointCloud(room.points), viewpoints=[[0.1, 0.0, 0.0]])
    assert ((result.normals * room.normals).sum(axis=1) < 0).all()
