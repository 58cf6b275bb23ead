"""Open3D's functions that turn signs, with the real Open3D: alone and under `install`, for both its APIs."""

import numpy as np
import pytest

from face_plugin import Params, estimate_normals, orient_normals
from face_plugin.adapters import open3d as face
from face_plugin.shapes import box, disjoint_spheres

o3d = pytest.importorskip("open3d")

BALLS = disjoint_spheres(800)
ROOM = box(900)
MIXED = np.where(np.arange(900) % 2, 1.0, -1.0)[:, None]
NAMES = (
    "orient_normals_consistent_tangent_plane",
    "orient_normals_towards_camera_location",
    "orient_normals_to_align_with_direction",
)


def legacy(shape):
    pcd = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(shape.points))
    pcd.normals = o3d.utility.Vector3dVector(shape.normals * MIXED[: len(shape)])
    return pcd


def tensor(shape):
    pcd = o3d.t.geometry.PointCloud(shape.points.astype(np.float32))
    pcd.point.normals = o3d.core.Tensor((shape.normals * MIXED[: len(shape)]).astype(np.float32))
    pcd.point["label"] = o3d.core.Tensor(np.arange(len(shape)))
    return pcd


def normals_of(pcd):
    return pcd.point.normals.numpy() if hasattr(pcd, "point") else np.asarray(pcd.normals)


def as_function(pcd, name, *arguments, **named):
    return getattr(face, name)(pcd, *arguments, **named)


def as_method(pcd, name, *arguments, **named):
    with face.installed():
        return getattr(pcd, name)(*arguments, **named)


WAYS = pytest.mark.parametrize("call", [as_function, as_method])
BOTH = pytest.mark.parametrize("make", [legacy, tensor])


@WAYS
@BOTH
def test_signs_alone_are_turned_outward_in_place(make, call):
    pcd = make(BALLS)
    lines = normals_of(pcd).copy()
    assert call(pcd, NAMES[0], 15, 0.0, cos_alpha_tol=1.0) is None
    turned = normals_of(pcd)
    assert turned.dtype == lines.dtype
    assert ((turned == lines) | (turned == -lines)).all()
    # Open3D alone turns one of the two spheres inward.
    assert ((turned * BALLS.normals).sum(axis=1) > 0).all()


@WAYS
@BOTH
def test_a_camera_in_a_room_turns_its_walls_to_it(make, call):
    for arguments in ((), ([0.1, 0.0, 0.2],), (np.array([[0.1, 0.0, 0.0]]),)):
        pcd = make(ROOM)
        assert call(pcd, NAMES[1], *arguments) is None
        assert ((normals_of(pcd) * ROOM.normals).sum(axis=1) < 0).all()
    pcd = make(ROOM)
    call(pcd, NAMES[1], camera_location=o3d.core.Tensor([50.0, 0.0, 0.0]))
    assert ((normals_of(pcd) * ROOM.normals).sum(axis=1) > 0).all()


@WAYS
@BOTH
def test_a_direction_turns_a_sheet(make, call):
    side = np.stack(np.meshgrid(np.linspace(-1, 1, 25), np.linspace(-1, 1, 25)), axis=-1).reshape(-1, 2)
    sheet = type("Sheet", (), {"__len__": lambda self: 625})()
    sheet.points = np.column_stack([side, 0.1 * np.sin(3 * side[:, 0])])
    sheet.normals = np.tile([0.0, 0.0, 1.0], (625, 1))
    for sign, arguments in ((1, ()), (-1, ([0, 0, -2],))):
        pcd = make(sheet)
        assert call(pcd, NAMES[2], *arguments) is None
        assert np.array_equal(normals_of(pcd), sign * sheet.normals)


@pytest.mark.parametrize("name", NAMES)
@BOTH
def test_a_cloud_without_normals_is_a_runtime_error_as_of_open3d(make, name):
    pcd = make(ROOM)
    if hasattr(pcd, "point"):
        del pcd.point["normals"]
    else:
        pcd.normals = o3d.utility.Vector3dVector()
    with pytest.raises(RuntimeError, match=r"No normals in the PointCloud. Call estimate_normals"):
        as_method(pcd, name, *([15] if name == NAMES[0] else []))


@pytest.mark.parametrize("cloud", [o3d.geometry.PointCloud, o3d.t.geometry.PointCloud])
def test_an_empty_cloud_is_warned_of(cloud, caplog):
    for name in NAMES:
        as_function(cloud(), name)
    assert caplog.text.count("the point cloud is empty") == 3


def test_settings_reach_the_method():
    params = Params(cage_spacing=0.3)
    pcd = legacy(BALLS)
    given = normals_of(pcd).copy()
    face.orient_normals_consistent_tangent_plane(pcd, params=params)
    assert np.array_equal(normals_of(pcd), orient_normals(BALLS.points, given, params))


def test_sensors_reach_normals_interior_and_surface():
    pcd, views = legacy(ROOM), [[0.1, 0.0, 0.0]]
    face.estimate_normals(pcd, viewpoints=views)
    assert np.array_equal(normals_of(pcd), estimate_normals(ROOM.points, viewpoints=views).normals)
    assert ((normals_of(pcd) * ROOM.normals).sum(axis=1) < 0).all()
    assert len(face.remove_interior_points(pcd, viewpoints=views, seen_from=np.zeros(900, dtype=int))[1]) == 900
    blind = face.create_from_point_cloud_face(pcd, depth=5)[0]
    seen = face.create_from_point_cloud_face(pcd, depth=5, viewpoints=views)[0]
    # Turned inside out.
    assert blind.get_volume() == pytest.approx(-signed_volume(seen), rel=0.05)


def signed_volume(mesh):
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.triangles)]
    return np.linalg.det(corners).sum() / 6.0


@pytest.mark.parametrize(
    ("pcd", "params", "message"),
    [
        (ROOM.points, None, r"pcd must be an Open3D PointCloud, found ndarray: pass .*Vector3dVector\(points\)"),
        (o3d.geometry.TriangleMesh.create_box(), None, "found TriangleMesh: pass points of it, such as mesh.sample"),
        (None, None, "found NoneType"),
        (legacy(ROOM), {"alpha": 0.1}, r"params must be a face_plugin.Params or None, found dict: pass .*Params\(\*\*"),
    ],
)
def test_wrong_types_say_what_to_pass(pcd, params, message):
    calls = [
        face.estimate_normals,
        face.remove_interior_points,
        face.create_from_point_cloud_face,
        *(getattr(face, name) for name in NAMES),
    ]
    for call in calls:
        with pytest.raises(TypeError, match=message):
            call(pcd, params=params)


def test_a_dict_is_refused_by_install():
    with pytest.raises(TypeError, match=r"params must be a face_plugin.Params or None, found dict"):
        face.install({"alpha": 0.1})
    assert not legacy(ROOM).orient_normals_consistent_tangent_plane.__doc__.startswith("FaCE")
