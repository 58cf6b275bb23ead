"""Angles on what scanners leave: walls with noise, edges, scan lines, lattices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin import shapes
from face_plugin.angles.choice import combine_fits
from face_plugin.angles.fits import fit_surfaces
from face_plugin.angles.noise import find_noise
from face_plugin.angles.turning import turn_angles
from face_plugin.geometry import unit
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.planes import plane_fit


def off(normals, truth):
    """Angles (n,) between lines, in degrees."""
    return np.degrees(np.arccos(np.clip(np.abs((normals * truth).sum(axis=1)), 0, 1)))


def turned(points, truth, seed=0):
    """Angles found from sides that are some fifteen degrees off."""
    rough = unit(truth + 0.2 * np.random.default_rng(seed).normal(size=truth.shape))
    nobody = np.zeros(len(points), dtype=bool)
    return turn_angles(Neighbourhood(points), rough, nobody, nobody)


def plane_of_30(points):
    return plane_fit(points, *cKDTree(points).query(points, k=31), count=30, width=10.0)


def wall(sigma, n=4000, seed=0):
    rng = np.random.default_rng(seed)
    return np.stack([*rng.uniform(0, 1, (2, n)), rng.normal(0, sigma, n)], axis=1), np.tile([0.0, 0.0, 1.0], (n, 1))


# Spacing 0.016: noise from a thirtieth of it to more than it.
@pytest.mark.parametrize(("sigma", "most"), [(0.0005, 0.4), (0.003, 2.0), (0.02, 8.0)])
def test_a_noisy_wall_is_flat(sigma, most):
    points, truth = wall(sigma)
    error = off(turned(points, truth).normals, truth).mean()
    assert error < most
    assert error < 0.8 * off(plane_of_30(points), truth).mean()


def test_an_edge_stays_sharp_under_noise():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-1, 1, (2, 4000))
    truth = unit(np.stack([np.sign(x), 0 * x, 1 + 0 * x], axis=1))
    points = np.stack([x, y, -np.abs(x)], axis=1) + 0.002 * rng.normal(size=(4000, 1)) * truth
    near = np.abs(x) < 0.1
    found = off(turned(points, truth).normals, truth)
    assert found[near].mean() < 0.4 * off(plane_of_30(points), truth)[near].mean()
    assert np.median(found[near]) < 3


def test_a_box_keeps_its_edges():
    box = shapes.box(3000, 0)
    # Measured: 0.5 degrees in the mean; 5 with winding-number steps alone.
    assert off(turned(box.points, box.normals).normals, box.normals).mean() < 1.5


@pytest.mark.parametrize("apart", [3, 7, 10])
def test_scan_lines_want_neighbours_from_several_lines(apart):
    # Around a torus, rows `apart` times as far from one another as points along them.
    rows = 33
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 2 * np.pi, 2 * rows * apart, endpoint=False),
                                           np.linspace(0, 2 * np.pi, rows, endpoint=False), indexing="ij"))  # fmt: skip
    truth = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=1)
    points = np.stack([np.cos(u), np.sin(u), 0 * u], axis=1) + 0.35 * truth
    assert off(turned(points, truth).normals, truth).mean() < 0.5


def test_rings_of_a_spinning_sensor_on_the_ground():
    rng = np.random.default_rng(0)
    turn, ring = (a.ravel() for a in np.meshgrid(np.linspace(0, 2 * np.pi, 400, endpoint=False), np.arange(3.0, 15.0)))
    reach = ring + 0.005 * rng.normal(size=ring.size)
    ground = np.stack([reach * np.cos(turn), reach * np.sin(turn), 0.005 * rng.normal(size=ring.size)], axis=1)
    truth = np.tile([0.0, 0.0, 1.0], (len(ground), 1))
    assert off(turned(ground, truth).normals, truth).mean() < 1.5


def test_a_floor_rounded_to_a_lattice():
    rng = np.random.default_rng(0)
    floor = np.unique(
        np.round(np.stack([*rng.uniform(0, 1, (2, 6000)), rng.normal(0, 0.008, 6000)], axis=1), 2), axis=0
    )
    truth = np.tile([0.0, 0.0, 1.0], (len(floor), 1))
    assert off(turned(floor, truth).normals, truth).mean() < 5


def test_a_slope_rounded_to_a_lattice():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 1, (2, 6000))
    slope = np.unique(np.round(np.stack([x, y, 0.3 * x + 0.1 * y], axis=1), 2), axis=0)
    truth = np.tile(unit(np.array([[-0.3, -0.1, 1.0]])), (len(slope), 1))
    assert off(turned(slope, truth).normals, truth).mean() < 5


def test_the_expected_error_is_that_of_bodies_and_not_of_noise():
    ball = shapes.sphere(1500, 0)
    found = turned(ball.points, ball.normals)
    assert off(found.normals, ball.normals).mean() < 0.5
    noisy, truth = wall(0.005)
    assert np.degrees(np.sqrt(np.median(turned(noisy, truth).error))) < 2
    few = shapes.sphere(60, 0)
    assert np.median(turned(few.points, few.normals).error) > 20 * np.median(found.error)


@pytest.mark.parametrize("angle", [30, 50, 70])
def test_no_normal_on_a_sharp_edge_is_that_of_the_other_face(angle):
    # A wedge of that angle, its edge along y; the sides found are smooth across the edge.
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 1, (2, 4000))
    upper = rng.random(4000) < 0.5
    half = np.radians(angle / 2)
    sign = np.where(upper, 1.0, -1.0)
    points = np.stack([-x * np.cos(half), y, sign * x * np.sin(half)], axis=1)
    truth = np.stack([np.full(4000, np.sin(half)), np.zeros(4000), sign * np.cos(half)], axis=1)
    blur = np.minimum(x / 0.06, 1.0)[:, None]
    side = unit(blur * truth + (1 - blur) * np.array([1.0, 0, 0]))
    found = turn_angles(Neighbourhood(points), side, np.zeros(4000, dtype=bool), np.zeros(4000, dtype=bool))
    wrong = (found.normals * truth).sum(axis=1) < 0
    assert wrong.mean() < 0.003
    assert off(found.normals, truth).mean() < 0.5 * off(side, truth).mean()


def test_the_side_is_kept_and_who_stays_stays():
    points, truth = wall(0.01, n=1000)
    side = truth * np.where(np.random.default_rng(0).random(1000) < 0.2, -1.0, 1.0)[:, None]
    still = np.arange(1000) < 100
    found = turn_angles(Neighbourhood(points), side, np.zeros(1000, dtype=bool), still)
    assert ((found.normals * side).sum(axis=1) > 0).all()
    np.testing.assert_array_equal(found.normals[still], side[still])
    assert (found.width[still] == 0).all()


def test_noise_alone_does_not_pick_neighbours_fits():
    # On a noisy wall no fit is better than another but by chance: what is found is hardly worse than the largest.
    points, truth = wall(0.01)
    neighbour = cKDTree(points).query(points, k=97)[1]
    fits = fit_surfaces(points, truth, neighbour)
    found, error = combine_fits(points, truth, truth, neighbour, fits, find_noise(points, fits, neighbour)[0])
    slope = np.linalg.norm(fits.plane[-1, :, 1:3], axis=1)
    assert off(found, truth).mean() < 1.4 * np.degrees(slope).mean()
    # The expected error is that of one fit: it is of the right order.
    assert 0.3 < off(found, truth).mean() / np.degrees(np.sqrt(np.median(error))) < 3


@pytest.mark.parametrize("n", [5, 12, 30])
def test_few_points_are_enough(n):
    ball = shapes.sphere(n, 0)
    found = turned(ball.points, ball.normals)
    assert np.isfinite(found.normals).all()
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1)
