"""Confidence ranks errors."""

from __future__ import annotations

import numpy as np

from face_plugin import FaCE, shapes
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
