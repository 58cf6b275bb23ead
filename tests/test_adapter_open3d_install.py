"""Open3D scripts under `install`: unchanged lines, FaCE's normals, and Open3D itself again afterwards."""

import numpy as np
import pytest

from face_plugin import Params, estimate_normals
from face_plugin.adapters.open3d import install, installed, uninstall
from face_plugin.shapes import disjoint_spheres

o3d = pytest.importorskip("open3d")

SHAPE = disjoint_spheres(800)
CLOUDS = (o3d.geometry.PointCloud, o3d.t.geometry.PointCloud)
NAMES = (
    "estimate_normals",
    "orient_normals_consistent_tangent_plane",
    "orient_normals_towards_camera_location",
    "orient_normals_to_align_with_direction",
)


@pytest.fixture(autouse=True)
def _originals():
    before = [cloud.__dict__[name] for cloud in CLOUDS for name in NAMES]
    yield
    uninstall()
    after = [cloud.__dict__[name] for cloud in CLOUDS for name in NAMES]
    assert all(a is b for a, b in zip(before, after, strict=True))


def legacy():
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(SHAPE.points))


def tensor():
    return o3d.t.geometry.PointCloud(SHAPE.points.astype(np.float32))


def script(pcd):
    """What stands in many scripts."""
    pcd.estimate_normals(search_param=o3d.geometry.KDTreeSearchParamHybrid(radius=0.3, max_nn=30))
    pcd.orient_normals_consistent_tangent_plane(15)
    return np.asarray(pcd.normals).copy()


def outward(normals):
    return ((normals * SHAPE.normals).sum(axis=1) > 0).mean()


def test_a_script_that_orients_one_sphere_inward_is_right_under_install():
    assert outward(script(legacy())) < 0.75  # Open3D alone: the spheres hold 67 % and 33 % of the points
    install()
    assert np.array_equal(script(legacy()), estimate_normals(SHAPE.points).normals)
    assert outward(script(legacy())) == 1.0
    uninstall()
    assert outward(script(legacy())) < 0.75


def test_a_tensor_script_too():
    with installed():
        pcd = tensor()
        assert pcd.estimate_normals(30, 0.3) is None
        assert pcd.orient_normals_consistent_tangent_plane(15) is None
        expected = estimate_normals(SHAPE.points.astype(np.float32)).normals
        assert np.array_equal(pcd.point.normals.numpy(), expected)
        pcd.estimate_normals(max_nn=20)
        pcd.estimate_normals(radius=None)
        pcd.estimate_normals()


@pytest.mark.parametrize("make", [legacy, tensor])
def test_normals_that_are_consistent_already_are_not_solved_again(make, caplog):
    pcd = make()
    with installed(), caplog.at_level("DEBUG", logger="face_plugin.adapters.open3d"):
        pcd.estimate_normals()
        pcd.orient_normals_consistent_tangent_plane(15)
        assert caplog.text.count("skipped") == 1
        # Unless a script changed them in between.
        if make is tensor:
            pcd.point.normals[:100] *= -1
        else:
            np.asarray(pcd.normals)[:100] *= -1
        pcd.orient_normals_consistent_tangent_plane(15)
        assert caplog.text.count("skipped") == 1
    assert outward(pcd.point.normals.numpy() if make is tensor else np.asarray(pcd.normals)) == 1.0


def test_normals_from_elsewhere_keep_their_lines():
    pcd = legacy()
    mixed = SHAPE.normals * np.where(np.arange(800) % 2, 1, -1)[:, None]
    pcd.normals = o3d.utility.Vector3dVector(mixed)
    with installed():
        pcd.orient_normals_consistent_tangent_plane(15)
    assert np.array_equal(np.asarray(pcd.normals), SHAPE.normals)


def test_settings_of_install_reach_the_method():
    params = Params(cage_spacing=0.3)
    with installed(params):
        assert np.array_equal(script(legacy()), estimate_normals(SHAPE.points, params).normals)


def test_blocks_nest_and_give_back_what_was_before():
    outer, inner = Params(cage_spacing=0.3), Params(cage_spacing=0.2)
    install(outer)
    with installed(inner):
        assert np.array_equal(script(legacy()), estimate_normals(SHAPE.points, inner).normals)
    assert np.array_equal(script(legacy()), estimate_normals(SHAPE.points, outer).normals)


def fail_inside_a_block():
    with installed():
        raise KeyError("inside")


def test_an_error_in_a_block_gives_open3d_back():
    before = o3d.geometry.PointCloud.__dict__["estimate_normals"]
    with pytest.raises(KeyError):
        fail_inside_a_block()
    assert o3d.geometry.PointCloud.__dict__["estimate_normals"] is before


def test_wrong_arguments_are_type_errors_as_without_install():
    with installed():
        for pcd, arguments in ((legacy(), {"max_nn": 3}), (tensor(), {"search_param": None})):
            with pytest.raises(TypeError, match="unexpected keyword argument"):
                pcd.estimate_normals(**arguments)


def test_installing_and_uninstalling_twice_does_no_harm():
    install()
    install()
    uninstall()
    uninstall()
    assert outward(script(legacy())) < 0.75
