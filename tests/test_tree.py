"""The nearest points of all points at once, against a search for each."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin import shapes
from face_plugin.tree import PointTree

RNG = np.random.default_rng(0)
CLOUDS = {
    "volume": RNG.normal(size=(500, 3)),
    "surface": shapes.torus(3000, 0).points,
    "as many as asked for": RNG.normal(size=(97, 3)),
    "few": RNG.normal(size=(5, 3)),
    "one": np.zeros((1, 3)),
    "clusters of every scale": np.concatenate(
        [1e-6 * RNG.normal(size=(300, 3)), RNG.normal(size=(300, 3)), 1e-3 * RNG.normal(size=(300, 3)) + 50]
    ),
    "a stray beside a cluster": np.concatenate([1e-3 * RNG.normal(size=(2000, 3)), [[100.0, 0.0, 0.0]]]),
    "a cluster of no size to a stray's eyes": np.concatenate([1e-170 * RNG.normal(size=(150, 3)), [[1e3, 0.0, 0.0]]]),
    "line": np.linspace(0, 1, 400)[:, None] * [[1.0, 2.0, 3.0]],
    "plane": RNG.uniform(size=(700, 2)),
}


@pytest.mark.parametrize("name", CLOUDS)
def test_as_a_search_for_each_point(name):
    points = CLOUDS[name]
    count = min(97, len(points))
    distance, row = PointTree(points).nearest(count)
    expected = cKDTree(points).query(points, k=[*range(1, count + 1)])[0]
    np.testing.assert_allclose(distance, expected, rtol=1e-12)
    np.testing.assert_array_equal(row[:, 0], np.arange(len(points)))
    assert all(len(set(of)) == count for of in row)
    np.testing.assert_allclose(np.linalg.norm(points[row] - points[:, None], axis=2), distance, rtol=1e-12)


def test_points_as_near_as_each_other_are_all_there():
    lattice = np.argwhere(np.ones((9, 9, 9))).astype(float)
    distance, row = PointTree(lattice).nearest(40)
    np.testing.assert_array_equal(distance, cKDTree(lattice).query(lattice, k=40)[0])
    assert all(len(set(of)) == 40 for of in row)


def test_each_node_holds_the_points_of_its_children():
    tree = PointTree(CLOUDS["surface"])
    parents = np.flatnonzero(tree.child >= 0)
    child = tree.child[parents]
    np.testing.assert_array_equal(tree.start[child], tree.start[parents])
    np.testing.assert_array_equal(tree.stop[child], tree.start[child + 1])
    np.testing.assert_array_equal(tree.stop[child + 1], tree.stop[parents])
    assert sorted(tree.order) == list(range(3000))
    assert (np.diff(tree.groups) > 0).all()
    assert np.diff(tree.groups).max() <= 16


def test_radii_reach_the_farthest_point():
    tree = PointTree(CLOUDS["volume"])
    centre = tree.sums(tree.points) / tree.sums(np.ones((500, 1)))
    radius = tree.radii(centre)
    for node in (0, 1, 2, 7, len(radius) - 1):
        mine = tree.points[tree.start[node] : tree.stop[node]]
        np.testing.assert_allclose(centre[node], mine.mean(axis=0))
        np.testing.assert_allclose(radius[node], np.linalg.norm(mine - mine.mean(axis=0), axis=1).max())
