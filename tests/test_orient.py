"""Signs alone: given lines are turned by the method's side of them, and spread along sheets."""

import numpy as np
import pytest

from face_plugin import Execution, orient_normals
from face_plugin.shapes import box, sphere


def mixed(normals, seed=0):
    """Turn half of the normals, at random."""
    return normals * np.random.default_rng(seed).choice([-1.0, 1.0], len(normals))[:, None].astype(normals.dtype)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_only_signs_are_turned_and_the_dtype_is_kept(dtype):
    ball = sphere(800)
    # Lines of the user's own: off the true ones, and of any length.
    own = (ball.normals + 0.2 * np.random.default_rng(1).standard_normal((800, 3))) * np.linspace(0.1, 9, 800)[:, None]
    given = mixed(own.astype(dtype))
    before = given.copy()
    turned = orient_normals(ball.points.astype(dtype), given)
    assert turned.dtype == dtype
    assert np.array_equal(turned, own.astype(dtype))
    assert np.array_equal(given, before)


def test_a_room_seen_from_inside_points_inward():
    room = box(1500)
    given = mixed(room.normals)
    assert ((orient_normals(room.points, given) * room.normals).sum(axis=1) > 0).all()
    inside = orient_normals(room.points, given, viewpoints=[[0.1, 0.0, 0.2]])
    assert ((inside * room.normals).sum(axis=1) < 0).all()


def test_an_up_direction_turns_a_sheet():
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 30), np.linspace(-1, 1, 30)), axis=-1).reshape(-1, 2)
    terrain = np.column_stack([grid, 0.2 * np.sin(3 * grid[:, 0])])
    line = np.column_stack([-0.6 * np.cos(3 * grid[:, 0]), np.zeros(900), np.ones(900)])
    for up in ([0, 0, 1], [0, 0, -2]):
        turned = orient_normals(terrain, mixed(line), up=up)
        assert (turned[:, 2] * up[2] > 0).all()


def test_trusted_normals_are_kept_and_handed_on():
    ball = sphere(1000)
    inward, trusted = mixed(ball.normals), np.zeros(1000, dtype=bool)
    trusted[:5] = True
    inward[:5] = -ball.normals[:5]
    assert np.array_equal(orient_normals(ball.points, inward, trusted=trusted), -ball.normals)
    # Also where they contradict one another.
    inward[2] = ball.normals[2]
    turned = orient_normals(ball.points, inward, trusted=trusted)
    assert np.array_equal(turned[:5], inward[:5])


def test_coinciding_points_and_strays_are_turned_as_well():
    ball = sphere(600)
    points = np.concatenate([ball.points, ball.points[:50], [[9.0, 0.0, 0.0]]])
    normals = np.concatenate([ball.normals, ball.normals[:50], [[1.0, 0.0, 0.0]]])
    turned = orient_normals(points, mixed(normals))
    assert np.array_equal(turned[:650], normals[:650])


def test_a_cloud_in_tiles_and_what_it_cannot_do():
    ball, tiles = sphere(2500), Execution(tile_points=1500, engine="serial")
    assert np.array_equal(orient_normals(ball.points, mixed(ball.normals), execution=tiles), ball.normals)
    with pytest.raises(ValueError, match="trusted needs the cloud in one piece"):
        orient_normals(ball.points, ball.normals, execution=tiles, trusted=np.ones(2500, dtype=bool))


def spoilt(value):
    normals = sphere(50).normals.copy()
    normals[7] = value
    return normals


@pytest.mark.parametrize(
    ("normals", "message"),
    [
        (spoilt(0.0), r"not of length 0, found \[0.0, 0.0, 0.0\] in row 7"),
        (spoilt(np.nan), "must be finite"),
        (spoilt(np.inf), "must be finite"),
        (sphere(50).normals[:9], r"normals must be \(50, 3\) numbers"),
        (np.full((50, 3), "a"), r"normals must be \(50, 3\) numbers"),
    ],
)
def test_bad_normals_are_named(normals, message):
    with pytest.raises(ValueError, match=message):
        orient_normals(sphere(50).points, normals)


def test_bad_trust_and_settings_are_named():
    ball = sphere(50)
    with pytest.raises(ValueError, match="trusted must hold 50 booleans, found"):
        orient_normals(ball.points, ball.normals, trusted=np.ones(50))
    with pytest.raises(TypeError, match=r"params must be a face_plugin.Params or None, found dict: pass .*settings"):
        orient_normals(ball.points, ball.normals, {"alpha": 0.1})


def test_tiny_and_huge_normals_are_no_zeros():
    ball = sphere(300)
    for length in (1e-200, 1e200):
        assert np.array_equal(orient_normals(ball.points, mixed(ball.normals) * length), ball.normals * length)
