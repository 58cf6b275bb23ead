"""Depth and memory of Poisson reconstruction."""

import logging

import numpy as np
import pytest

from face_plugin import surface
from face_plugin.shapes import sphere
from face_plugin.surface import poisson_reconstruction, reconstruction_memory, suggested_depth, warn_if_too_large


def random_sphere(n):
    points = np.random.default_rng(0).normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def test_the_depth_follows_the_spacing_and_not_the_unit():
    points = random_sphere(50_000)
    depth = suggested_depth(points)
    # Uniform: 4 pi / 50,000 a point, a mean distance of 1.5 spacings to six neighbours: a cell in 2.2 /
    # 0.021.
    assert depth == 7
    assert suggested_depth(points * 1e-6 + 5.0) == depth
    # A quarter of the points, twice the spacing.
    assert suggested_depth(points[::4]) == depth - 1
    assert suggested_depth(random_sphere(100)) == 5
    assert suggested_depth(np.zeros((10, 3))) == 12


# Peak of the process above that before, measured with Open3D 0.19 on these points.
@pytest.mark.parametrize(
    ("n", "depth", "gigabytes"), [(200_000, 7, 0.070), (200_000, 8, 0.213), (200_000, 10, 0.564), (20_000, 10, 0.114)]
)
def test_memory_as_measured(n, depth, gigabytes):
    assert 0.5 < reconstruction_memory(random_sphere(n), depth) / 1e9 / gigabytes < 2.0


def test_a_warning_with_numbers(monkeypatch, caplog):
    points = random_sphere(5000)
    warn_if_too_large(points, 6)
    assert not caplog.records
    monkeypatch.setattr(surface, "available_memory", lambda: 1e6)
    with caplog.at_level(logging.WARNING):
        warn_if_too_large(points, 9)
    assert "depth 9 from 5000 points takes about 0.0" in caplog.text
    assert "a depth of 6" in caplog.text


def test_depth_from_the_spacing_reconstructs():
    ball = sphere(2000)
    chosen = poisson_reconstruction(ball.points, ball.normals, depth=None, backend="open3d")
    given = poisson_reconstruction(ball.points, ball.normals, depth=5, backend="open3d")
    assert len(chosen[1]) == len(given[1])
