"""The winding-number field of oriented points."""

from __future__ import annotations

import numpy as np
import pytest
import reference

from face_plugin import shapes
from face_plugin.geometry import unit
from face_plugin.winding import DipoleTree


@pytest.fixture(scope="module")
def cloud():
    shape = shapes.torus(700, 0)
    rng = np.random.default_rng(0)
    areas, eps = rng.uniform(0.5, 1.5, 700) * 1e-3, rng.uniform(0.02, 0.2, 700)
    return shape.points, shape.normals, areas, eps


def test_opening_zero_is_the_exact_sum(cloud):
    points, normals, areas, eps = cloud
    tree = DipoleTree(points, areas)
    expected, _ = reference.winding_sums(points, normals, areas, eps)
    np.testing.assert_allclose(tree.outward(normals, eps, 0.0), expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_the_tree_is_near_the_exact_sum(cloud):
    points, normals, areas, eps = cloud
    tree = DipoleTree(points, areas)
    expected, number = reference.winding_sums(points, normals, areas, eps)
    cosine = (unit(tree.outward(normals, eps)) * unit(expected)).sum(axis=1)
    # Measured: mean 0.05 degrees.
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 0.2
    np.testing.assert_allclose(tree.number(normals, eps), number, atol=0.02)


def test_the_order_of_points_does_not_matter_when_exact(cloud):
    points, normals, areas, eps = cloud
    turn = np.random.default_rng(1).permutation(len(points))
    one = DipoleTree(points, areas).outward(normals, eps, 0.0)
    other = DipoleTree(points[turn], areas[turn]).outward(normals[turn], eps[turn], 0.0)
    np.testing.assert_allclose(other, one[turn], rtol=0, atol=1e-6 * np.abs(one).max())


def test_number_is_a_half_on_the_surface_and_one_inside():
    ball = shapes.sphere(4000, 0)
    points = np.concatenate([ball.points, 0.5 * ball.points[:50]])
    normals = np.concatenate([ball.normals, np.zeros((50, 3))])
    areas = np.full(len(points), 4 * np.pi / 4000)
    w = DipoleTree(points, areas).number(normals, np.full(len(points), 0.03))
    assert np.median(w[:4000]) == pytest.approx(0.5, abs=0.03)
    np.testing.assert_allclose(w[4000:], 1, atol=0.02)


def test_the_gradient_and_the_number_come_together(cloud):
    points, normals, areas, eps = cloud
    tree = DipoleTree(points, areas)
    outward, number = tree.outward_and_number(normals, eps)
    assert np.array_equal(outward, tree.outward(normals, eps))
    assert np.array_equal(number, tree.number(normals, eps))


def test_distance_and_scale_take_no_digits_away(cloud):
    points, normals, areas, eps = cloud
    one = DipoleTree(points, areas).outward(normals, eps)
    for scale in (2.0**-60, 2.0**60):
        other = DipoleTree(scale * points, scale**2 * areas).outward(normals, scale * eps)
        np.testing.assert_allclose(scale * other, one, rtol=0, atol=1e-6 * np.abs(one).max())
    moved = DipoleTree(points + 1e6, areas).outward(normals, eps)
    np.testing.assert_allclose(moved, one, rtol=0, atol=1e-5 * np.abs(one).max())


@pytest.mark.parametrize("scale", [1e-3, 1e-6, 1e-9])
def test_a_tiny_cluster_beside_a_large_one_is_as_if_alone(cloud, scale):
    points, normals, areas, eps = cloud
    alone = DipoleTree(points, areas).outward(normals, eps)
    both = DipoleTree(
        np.concatenate([scale * points, points + np.array([3.0, 0.0, 0.0])]), np.concatenate([scale**2 * areas, areas])
    ).outward(np.concatenate([normals, normals]), np.concatenate([scale * eps, eps]))
    tolerance = 0.02 * np.abs(alone).max()
    np.testing.assert_allclose(scale * both[: len(points)], alone, rtol=0, atol=tolerance)
    np.testing.assert_allclose(both[len(points) :], alone, rtol=0, atol=tolerance)
