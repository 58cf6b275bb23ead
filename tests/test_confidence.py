"""Confidence ranks errors."""

from __future__ import annotations

import numpy as np
import pytest

import face_plugin
from face_plugin import FaCE, examples, shapes
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.confidence import confidence


def test_confidence_is_high_on_a_clean_sphere_and_within_bounds():
    result = FaCE(shapes.sphere(1500, 0).points).result()
    assert result.confidence.min() >= 0
    assert result.confidence.max() <= 1
    assert np.median(result.confidence) > 0.85


def test_the_least_confident_points_are_wrong_most_often():
    # Noise three times as large as the spacing: deep in the band in which points scatter, no one can tell their side.
    torus = shapes.with_noise(shapes.torus(2000, 0), 0.2)
    result = FaCE(torus.points).result()
    wrong = (result.normals * torus.normals).sum(axis=1) < 0
    assert wrong.mean() > 0.02
    # Measured: 2.0 to 2.2 times as often as anywhere, over four seeds.
    least = np.argsort(result.confidence)[: len(wrong) // 3]
    assert wrong[least].mean() > 1.5 * wrong.mean()


def test_confidence_of_some_points_is_that_among_all():
    ball, rows = shapes.sphere(500, 0), np.array([3, 100, 77])
    around = Neighbourhood(ball.points)
    every = confidence(around, ball.normals, ball.normals)
    assert np.array_equal(confidence(around, ball.normals, ball.normals, rows), every[rows])


@pytest.mark.parametrize("gap", [0.01, 0.1, 0.3])
def test_plates_whose_layers_nobody_can_tell_apart_say_so(gap):
    # Two lattices of spacing 1: half of the normals are on the wrong side, and no witness says which.
    rows = np.stack(np.meshgrid(np.arange(24.0), np.arange(24.0)), axis=-1).reshape(-1, 2)
    points = np.concatenate([np.column_stack([rows, np.full(len(rows), height)]) for height in (0.0, gap)])
    thick = points * [1.0, 1.0, 2.0 / gap]
    assert np.median(FaCE(points).result().confidence) < 0.05
    assert np.median(FaCE(thick).result().confidence) > 0.8


def test_a_side_that_was_chosen_is_not_trusted_and_one_that_was_seen_is():
    terrain = examples.load("terrain", 4000)
    blind = face_plugin.estimate_normals(terrain.points)
    seen = face_plugin.estimate_normals(terrain.points, up=terrain.up)
    assert np.median(blind.confidence) < 0.3 < 0.7 < np.median(seen.confidence)
