"""Normals at open borders."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin import reconstruct, shapes
from face_plugin.angles.borders import bend_borders
from face_plugin.shapes.solids import cone


@pytest.fixture(scope="module")
def stem() -> np.ndarray:
    """A tube, closed below and open above, as the stem of a sketch is."""
    points = shapes.from_solids([cone(0.5, 0.5, 2.0)], 2500, 0).points
    return points[points[:, 2] < points[:, 2].max() - 1e-9]


def test_the_surface_over_an_open_end_turns_in(stem):
    surface = reconstruct(stem)
    top = stem[:, 2].max()
    rim = stem[:, 2] > top - 0.05
    # Measured over seeds 0 to 2: 0.45 to 0.51, without the step 0.08 to 0.09.
    assert surface.result.normals[rim, 2].mean() > 0.3
    # A bulge of 0.21 to 0.22 above the rim; 0.27 to 0.28 without the step.
    assert surface.vertices[:, 2].max() - top < 0.245


def test_without_a_border_and_without_field_nothing_bends():
    ball = shapes.sphere(1000, 0)
    neighbour = cKDTree(ball.points).query(ball.points, k=25)[1]
    away = np.roll(ball.normals, 1, axis=1)
    strong = np.full(1000, 5.0)
    np.testing.assert_allclose(bend_borders(ball.points, ball.normals, away, strong, neighbour), ball.normals)

    half = ball.points[:, 2] > 0
    points, normals = ball.points[half], ball.normals[half]
    neighbour = cKDTree(points).query(points, k=25)[1]
    down = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    weak = np.ones(len(points))
    np.testing.assert_allclose(bend_borders(points, normals, down, weak, neighbour), normals)
    bent = bend_borders(points, normals, down, 5.0 * weak, neighbour)
    changed = np.abs(bent - normals).max(axis=1) > 1e-9
    assert (points[changed, 2] < 0.2).all()
    assert (bent[changed, 2] < normals[changed, 2]).all()
    # Only downward, over the border: the field pulls nothing back.
    np.testing.assert_allclose(bend_borders(points, normals, -down, 5.0 * weak, neighbour), normals)
