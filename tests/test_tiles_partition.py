"""Partition of a cloud into tiles."""

import numpy as np
import pytest

from face_plugin.tiles.partition import split

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("tiles", [1, 2, 3, 7, 16])
def test_tiles_hold_equally_many_points(tiles):
    points = RNG.normal(size=(1000, 3)) * [1.0, 5.0, 0.2]
    partition = split(points, tiles)
    count = np.bincount(partition.assign(points), minlength=tiles)
    assert partition.tiles == tiles
    assert count.sum() == 1000
    # Every cut rounds a share down by less than a point: at most one for each of the four levels.
    assert np.ptp(count) <= 4


def test_a_tile_is_a_box_and_boxes_do_not_overlap():
    points = RNG.random((2000, 3))
    partition = split(points, 8)
    tile = partition.assign(points)
    lower = np.array([points[tile == k].min(axis=0) for k in range(8)])
    upper = np.array([points[tile == k].max(axis=0) for k in range(8)])
    for a in range(8):
        for b in range(a):
            assert ((lower[a] > upper[b]) | (lower[b] > upper[a])).any()


def test_position_alone_decides():
    points = RNG.random((500, 3))
    partition = split(points, 5)
    order = RNG.permutation(500)
    assert np.array_equal(partition.assign(points[order]), partition.assign(points)[order])
    assert np.array_equal(split(points[order], 5).assign(points), partition.assign(points))
    parts = np.concatenate([partition.assign(points[:123]), partition.assign(points[123:])])
    assert np.array_equal(parts, partition.assign(points))


def test_points_outside_the_sample_belong_to_a_tile():
    partition = split(RNG.random((100, 3)), 6)
    far = partition.assign(RNG.normal(scale=100.0, size=(50, 3)))
    assert far.min() >= 0
    assert far.max() < 6


def test_coordinates_that_many_points_share():
    grid = np.stack(np.meshgrid(range(4), range(4), [0]), axis=-1).reshape(-1, 3).astype(float)
    points = np.repeat(grid, 50, axis=0)
    partition = split(points, 16)
    count = np.bincount(partition.assign(points), minlength=partition.tiles)
    assert count.min() > 0
    assert count.sum() == len(points)
    # One place cannot be cut.
    assert split(np.zeros((10, 3)), 4).tiles == 1


def test_most_points_at_the_lowest_coordinate():
    points = np.zeros((100, 3))
    points[90:, 0] = 1.0
    partition = split(points, 2)
    assert np.bincount(partition.assign(points)).tolist() == [90, 10]
