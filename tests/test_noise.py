"""The noise of points, told from the shape of their surface."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin import shapes
from face_plugin.angles.fits import fit_surfaces
from face_plugin.angles.noise import find_noise, on_lattice
from face_plugin.medians import medians


def found(points, normals):
    neighbour = cKDTree(points).query(points, k=min(97, len(points)))[1]
    noise, least = find_noise(points, fit_surfaces(points, normals, neighbour), neighbour)
    return np.sqrt(noise), np.sqrt(least)


@pytest.mark.parametrize("sigma", [0.003, 0.01, 0.03])
def test_noise_on_a_wall_is_measured(sigma):
    rng = np.random.default_rng(0)
    # About 0.03 apart: from a tenth of the spacing to the spacing.
    wall = np.stack([*rng.uniform(0, 1, (2, 2000)), rng.normal(0, sigma, 2000)], axis=1)
    noise, _ = found(wall, np.tile([0.0, 0.0, 1.0], (2000, 1)))
    assert np.median(noise) == pytest.approx(sigma, rel=0.25)


def test_noise_on_a_curved_surface_is_measured():
    ball = shapes.with_noise(shapes.sphere(3000, 0), 0.01, 0)
    noise, _ = found(ball.points, ball.normals)
    assert np.median(noise) == pytest.approx(0.01, rel=0.3)


def test_bending_is_not_noise():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 1, (2, 2000))
    waves = np.stack([x, y, 0.02 * np.sin(25 * x) * np.sin(25 * y)], axis=1)
    noise, least = found(waves, np.tile([0.0, 0.0, 1.0], (2000, 1)))
    assert np.median(noise) < 0.3 * np.median(least)


def test_an_edge_is_not_noise():
    box = shapes.box(3000, 0)
    noise, _ = found(box.points, box.normals)
    spacing = cKDTree(box.points).query(box.points, k=7)[0][:, 1:].mean()
    assert np.percentile(noise, 90) < 0.01 * spacing


def test_stairs_of_a_rounded_slope_are_noise():
    x, y = np.random.default_rng(0).uniform(0, 1, (2, 4000))
    slope = np.unique(np.round(np.stack([x, y, 0.2 * x - 0.1 * y], axis=1) / 0.016) * 0.016, axis=0)
    up = np.tile([0.0, 0.0, 1.0], (len(slope), 1))
    # Rounding leaves a twelfth of the squared step; stairs, as seen through small fits, somewhat less.
    assert np.median(found(slope, up)[0]) == pytest.approx(0.016 / np.sqrt(12), rel=0.4)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    near = cKDTree(slope @ turn).query(slope @ turn, k=2)[1]
    assert on_lattice(slope @ turn, near)


@pytest.mark.parametrize("make", [shapes.box, shapes.torus])
def test_even_samplings_are_no_lattice(make):
    points = make(2000, 0).points
    assert not on_lattice(points, cKDTree(points).query(points, k=2)[1])


def test_medians_leave_out_what_is_not_finite():
    values = np.array([5.0, np.inf, 1.0, 3.0])
    np.testing.assert_array_equal(medians(values, np.array([[0, 1, 2, 3], [1, 1, 1, 1], [2, 2, 1, 0]])), [3, np.inf, 1])
