"""Local fits: planes, and fits of several sizes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin.angles.fits import SIZES, fit_surfaces
from face_plugin.planes import plane_fit


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


def slopes_to_normals(fits, size, coefficients):
    """Unit normals of fits at their own points."""
    x, y, z = fits.frame.transpose(1, 0, 2)
    normals = z - coefficients[size, :, 1:2] * x - coefficients[size, :, 2:3] * y
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_a_plane_is_fitted_exactly():
    points, normals = patch(lambda x, y: 0.3 * x - 0.2 * y)
    found = plane_fit(points, *cKDTree(points).query(points, k=13), count=12, width=1.0)
    np.testing.assert_allclose(np.abs((found * normals).sum(axis=1)), 1, atol=1e-9)


@pytest.mark.parametrize("size", range(len(SIZES)))
def test_planes_and_quadrics_of_every_size_are_fitted_exactly(size):
    points, normals = patch(lambda x, y: 0.3 * x - 0.2 * y)
    rough = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    fits = fit_surfaces(points, rough, cKDTree(points).query(points, k=97)[1])
    # The ridge of 1e-7 shows.
    for coefficients in (fits.plane, fits.quadric):
        np.testing.assert_allclose(slopes_to_normals(fits, size, coefficients), normals, atol=1e-3)
    assert fits.variance[size].max() < 1e-7


def test_a_quadric_is_nearer_than_a_plane_and_leaves_no_residual():
    points, normals = patch(lambda x, y: 0.4 * x**2 - 0.3 * x * y)
    # In the true tangent planes, so that only the bending is left to find.
    fits = fit_surfaces(points, normals, cKDTree(points).query(points, k=25)[1])

    def error(coefficients):
        found = slopes_to_normals(fits, 1, coefficients)
        return np.degrees(np.arccos(np.clip((found * normals).sum(axis=1), -1, 1))).mean()

    assert error(fits.quadric) < 0.2 * error(fits.plane)
    assert np.median(fits.variance[1, :, 1]) < 0.05 * np.median(fits.variance[1, :, 0])


def test_the_gain_is_the_variance_of_the_slope_that_noise_causes():
    flat, _ = patch(lambda x, y: 0.0 * x, count=300)
    up = np.tile([0.0, 0.0, 1.0], (len(flat), 1))
    neighbour = cKDTree(flat).query(flat, k=24)[1]
    rng = np.random.default_rng(1)
    slopes = []
    for _ in range(200):
        fits = fit_surfaces(flat + [0, 0, 1e-4] * rng.normal(size=(len(flat), 1)), up, neighbour)
        slopes.append(np.stack([(c[1, :, 1:3] / 1.0) for c in (fits.plane, fits.quadric)], axis=1))
    measured = np.stack(slopes).var(axis=0).sum(axis=2) / 1e-8
    ratio = np.median(measured / fits.gain[1], axis=0)
    # The weights' own spread is taken as a mean: it is right to some ten percent.
    np.testing.assert_allclose(ratio, 1.0, atol=0.3)


def test_the_other_side_of_a_wall_takes_no_part():
    points, _ = patch(lambda x, y: 0.0 * x)
    both = np.concatenate([points, points - [0, 0, 0.05]])
    normals = np.repeat([[0.0, 0, 1], [0, 0, -1]], len(points), axis=0)
    fits = fit_surfaces(both, normals, cKDTree(both).query(both, k=48)[1])
    np.testing.assert_allclose(slopes_to_normals(fits, 2, fits.plane), normals, atol=1e-6)
    assert fits.variance[2].max() < 1e-9
    assert (fits.used[2] < 48).all()


def test_too_few_points_are_not_fitted():
    points, normals = patch(lambda x, y: 0.0 * x, count=10)
    fits = fit_surfaces(points, normals, cKDTree(points).query(points, k=10)[1])
    assert fits.variance.shape == (0, 10, 2)
