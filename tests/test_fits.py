"""Local fits."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from face_plugin.angles.fits import quadric_fits
from face_plugin.geometry import plane_fit


def patch(height, count=400, seed=0):
    """Sample z = height(x, y) over a square, with its unit normals."""
    x, y = np.random.default_rng(seed).uniform(-1, 1, (2, count))
    points = np.stack([x, y, height(x, y)], axis=1)
    step = 1e-6
    slope = [
        (height(x + step, y) - height(x - step, y)) / (2 * step),
        (height(x, y + step) - height(x, y - step)) / (2 * step),
    ]
    normals = np.stack([-slope[0], -slope[1], np.ones(count)], axis=1)
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_a_plane_is_fitted_exactly():
    points, normals = patch(lambda x, y: 0.3 * x - 0.2 * y)
    found = plane_fit(points, *cKDTree(points).query(points, k=13), count=12, width=1.0)
    np.testing.assert_allclose(np.abs((found * normals).sum(axis=1)), 1, atol=1e-9)


def test_a_quadric_is_nearer_than_a_plane_and_leaves_no_residual():
    points, normals = patch(lambda x, y: 0.4 * x**2 - 0.3 * x * y)
    distance, neighbour = cKDTree(points).query(points, k=25)
    plane = plane_fit(points, distance, neighbour, count=24, width=1.0)
    fitted, residual = quadric_fits(points, normals, neighbour, distance[:, 1:7].mean(axis=1), (25,))

    def error(found):
        return np.degrees(np.arccos(np.clip(np.abs((found * normals).sum(axis=1)), 0, 1))).mean()

    assert error(fitted[0]) < 0.2 * error(plane)
    assert np.nanmedian(residual) < 0.02


def test_residual_measures_noise_at_every_size():
    points, _ = patch(lambda x, y: 0.0 * x, count=2000)
    sigma = 0.02
    points[:, 2] += sigma * np.random.default_rng(1).normal(size=len(points))
    _, neighbour = cKDTree(points[:, :2]).query(points[:, :2], k=48)
    spacing = np.full(len(points), 1.0)
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    _, residual = quadric_fits(points, up, neighbour, spacing, (12, 48))
    # Twelve points leave six degrees of freedom: the median of the root lies some 5 % under sigma.
    np.testing.assert_allclose(np.sqrt((residual**2).mean(axis=1)), sigma, rtol=0.15)


def test_the_other_side_of_a_wall_takes_no_part():
    points, _ = patch(lambda x, y: 0.0 * x)
    both = np.concatenate([points, points - [0, 0, 0.05]])
    normals = np.repeat([[0.0, 0, 1], [0, 0, -1]], len(points), axis=0)
    neighbour = cKDTree(both).query(both, k=40)[1]
    fitted, residual = quadric_fits(both, normals, neighbour, np.full(len(both), 0.1), (40,))
    np.testing.assert_allclose(fitted[0], normals, atol=1e-6)
    assert np.nanmax(residual) < 1e-6
