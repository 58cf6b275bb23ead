"""The winding number of triangles against the sum over all of them."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from face_plugin.faraday.solid_angles import winding_number
from face_plugin.shapes import sphere


def every_angle(positions, corners, faces):
    """Add up every triangle's solid angle (Van Oosterom and Strackee 1983), in one array."""
    a, b, c = (corners[column] - positions[:, None] for column in faces.T)
    la, lb, lc = (np.linalg.norm(of, axis=2) for of in (a, b, c))
    below = la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb
    return np.arctan2((a * np.cross(b, c)).sum(2), below).sum(axis=1) / (2.0 * np.pi)


@pytest.fixture(scope="module")
def lumps():
    """Give two lumps that overlap, and a thin plate: long triangles and small ones."""
    rng = np.random.default_rng(0)
    corners, faces, first = [], [], 0
    for middle, size in (([0, 0, 0], [1, 1, 1]), ([0.8, 0, 0], [1, 0.5, 0.7]), ([0, 0, 1.5], [1, 1, 0.01])):
        points = sphere(400, seed=int(rng.integers(99))).points * size + middle
        hull = ConvexHull(points)
        # A hull's triangles face either way.
        turn = np.linalg.det(points[hull.simplices] - middle) < 0
        corners.append(points)
        faces.append(np.where(turn[:, None], hull.simplices[:, ::-1], hull.simplices) + first)
        first += len(points)
    return np.concatenate(corners), np.concatenate(faces).astype(np.int64)


def test_far_triangles_act_together_to_two_digits(lumps):
    corners, faces = lumps
    positions = np.random.default_rng(1).uniform(-1.5, 2.0, (2000, 3))
    exact = every_angle(positions, corners, faces)
    assert set(np.round(exact).astype(int)) == {0, 1, 2}
    assert np.abs(winding_number(positions, corners, faces) - exact).max() < 0.02


def test_near_triangles_are_exact(lumps):
    corners, faces = lumps
    middle = corners[faces].mean(axis=1)
    out = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    out *= 1e-6 / np.linalg.norm(out, axis=1, keepdims=True)
    step = winding_number(middle - out, corners, faces) - winding_number(middle + out, corners, faces)
    assert step == pytest.approx(1.0, abs=1e-3)


def test_a_hole_lets_it_fade(lumps):
    corners, faces = lumps
    kept = faces[corners[faces].mean(axis=1)[:, 1] < 0.5]
    assert 0.3 < winding_number(np.array([[0.0, 0.3, 0.0]]), corners, kept)[0] < 0.99


def test_one_triangle_and_positions_on_it():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    number = winding_number(np.array([[0.0, 0, 0], [0.2, 0.2, 0.0], [5.0, 5, 5]]), corners, np.array([[0, 1, 2]]))
    assert np.isfinite(number).all()
    assert abs(number[2]) < 0.01
