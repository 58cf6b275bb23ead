"""The generated samples: their truth is checked against what they were made from, and by the sensors' places."""

import json

import numpy as np
import pytest

from face_plugin import examples
from face_plugin.app.cli import main
from face_plugin.io import read_cloud
from face_plugin.ribbons.generator import teapot_solids
from face_plugin.shapes.scans import camera_rays, ring_rays, scan_boxes, sphere_rays

CUBE = ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))


@pytest.mark.parametrize("name", examples.NAMES)
def test_a_sample_is_what_it_says(name):
    scan, again, other = (examples.load(name, 400, seed) for seed in (0, 0, 1))
    assert scan.points.shape == scan.normals.shape == (400, 3)
    assert np.isfinite(scan.points).all()
    np.testing.assert_allclose(np.linalg.norm(scan.normals, axis=1), 1.0)
    np.testing.assert_array_equal(scan.points, again.points)
    assert not np.array_equal(scan.points, other.points)


@pytest.mark.parametrize("name", ["room", "street", "frame"])
def test_true_normals_face_a_sensor(name):
    scan = examples.load(name, 2000)
    sight = scan.viewpoints[:, None] - scan.points
    facing = np.einsum("knd,nd->kn", sight, scan.normals)
    assert (facing.max(axis=0) > 0).all()


def test_terrain_normals_are_those_of_its_slopes():
    scan = examples.load("terrain", 300_000)
    # A quadric through the points around in a dense sample, as a check that knows nothing of the formula.
    for row in (17, 4711, 12_345):
        x, y, z = (scan.points - scan.points[row]).T
        near = np.hypot(x, y).argsort()[:60]
        x, y, z = x[near], y[near], z[near]
        fit = np.linalg.lstsq(np.column_stack([x, y, x * x, x * y, y * y, np.ones(60)]), z, rcond=None)[0]
        slope = -scan.normals[row, :2] / scan.normals[row, 2]
        np.testing.assert_allclose(fit[:2], slope, atol=0.05)


def test_sketch_normals_point_out_of_its_solids():
    scan = examples.load("sketch", 500)
    levels = [
        np.stack([solid.level(scan.points + step * scan.normals) for solid in teapot_solids()])
        for step in (-0.02, 0.0, 0.02)
    ]
    own = np.abs(levels[1]).argmin(axis=0), np.arange(500)
    assert (levels[2][own] > levels[0][own]).all()


def test_rays_meet_the_nearest_face():
    rng = np.random.default_rng(0)
    inside = scan_boxes([CUBE], [[0.3, 0.5, 0.7]], sphere_rays(600), 600, rng)
    on_a_face = np.isclose(inside.points, CUBE[0]) | np.isclose(inside.points, CUBE[1])
    assert on_a_face.any(axis=1).all()
    # From outside, looking along x: only the near face.
    outside = scan_boxes([CUBE], [[-4.0, 1.0, 1.5]], camera_rays(40, 40, [1.0, 0.0, 0.0]), 300, rng)
    np.testing.assert_allclose(outside.points[:, 0], 0.0, atol=1e-12)
    np.testing.assert_array_equal(outside.normals, np.tile([-1.0, 0.0, 0.0], (300, 1)))
    # What stands in front hides what is behind.
    wall = ((2.0, -9.0, -9.0), (3.0, 9.0, 9.0))
    both = scan_boxes([wall, CUBE], [[-4.0, 1.0, 1.5]], np.array([[1.0, 0.0, 0.0]]), 1, rng)
    np.testing.assert_allclose(both.points, [[0.0, 1.0, 1.5]])


def test_reach_and_noise():
    rays = ring_rays(8, 100, -30.0, 30.0)
    with pytest.raises(ValueError, match=r"n: found 800, allowed is at most the \d+ rays"):
        scan_boxes([CUBE], [[0.5, 1.0, 1.5]], rays, 800, np.random.default_rng(0), reach=0.8)
    exact, noisy = (
        scan_boxes([CUBE], [[0.5, 1.0, 1.5]], rays, 800, np.random.default_rng(0), noise=noise) for noise in (0.0, 0.01)
    )
    moved = np.linalg.norm(noisy.points - exact.points, axis=1)
    assert 0.009 < np.sqrt((moved**2).mean()) < 0.011


def test_bad_names_and_counts():
    with pytest.raises(ValueError, match=r"name: found 'cow', allowed are object, room"):
        examples.load("cow")
    with pytest.raises(ValueError, match="n: found 3, allowed is 100 or more"):
        examples.load("room", 3)


def test_the_command_writes_points_and_says_where_sensors_stood(tmp_path, capsys):
    path = tmp_path / "room.ply"
    assert main(["example", "room", "-o", str(path), "--points", "300", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    expected = examples.load("room", 300)
    np.testing.assert_allclose(said["viewpoints"], expected.viewpoints)
    cloud = read_cloud(path)
    np.testing.assert_allclose(cloud.points, expected.points, rtol=1e-6)
    assert cloud.normals is None
    assert main(["example", "terrain", "-o", str(path), "--points", "300"]) == 0
    assert "up is [0.0, 0.0, 1.0]" in capsys.readouterr().out
    assert main(["example", "room", "-o", str(path), "--points", "3", "--quiet"]) == 2
