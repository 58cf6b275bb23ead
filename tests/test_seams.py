"""A smooth sheet has one side, and is not inside anything that it leads out of."""

from __future__ import annotations

import numpy as np
import pytest

from face_plugin import estimate_normals
from face_plugin.geometry import unit
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.shapes import nested_box, two_spheres
from face_plugin.shapes.curves import spiral
from face_plugin.sides.seams import across_seams


def scroll(count: int, turns: float, gap: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals of a rolled sheet of height 1, open at both ends; `gap` is between its turns."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi * turns, 20001)
    curve = (0.1 + gap * angle / (2 * np.pi))[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    step = np.sqrt(length[-1] / count)
    along, height = np.meshgrid(np.arange(0, length[-1], step), np.arange(0, 1, step))
    along, height = (of.ravel() + rng.uniform(-0.3, 0.3, of.size) * step for of in (along, height))
    x, y = (np.interp(along, length, curve[:, k]) for k in range(2))
    ahead = unit(np.gradient(curve, axis=0))
    normals = np.stack([np.interp(along, length, ahead[:, 1]), -np.interp(along, length, ahead[:, 0])], axis=1)
    return np.column_stack([x, y, height]), np.column_stack([unit(normals), np.zeros(len(x))])


@pytest.mark.parametrize("count", [3000, 12000])
def test_a_scroll_has_one_side_and_nothing_of_it_is_interior(count):
    """Its inner turns lie in the dark, and the outer ones enclose them; between turns are 4 and 8 spacings."""
    points, normals = scroll(count, 2.5, 0.15)
    result = estimate_normals(points, filter_interior=True)
    right = (np.einsum("nd,nd->n", result.normals, normals) > 0).mean()
    assert max(right, 1 - right) > 0.975
    assert not result.interior.any()


def test_a_spiral_in_the_plane_is_not_interior():
    result = estimate_normals(spiral(500).points, filter_interior=True)
    assert not result.interior.any()


@pytest.mark.parametrize("shape", [nested_box, two_spheres])
def test_what_lies_within_still_is(shape):
    body = shape(3000)
    found = estimate_normals(body.points, filter_interior=True).interior
    assert found[body.interior].mean() > 0.92  # what is less deep than the spacing counts as surface
    assert found[~body.interior].mean() < 0.002


def sheet(size: int = 24) -> np.ndarray:
    x, y = np.meshgrid(np.arange(float(size)), np.arange(float(size)))
    return np.stack([x.ravel(), y.ravel(), 0.2 * np.sin(x.ravel() / 3)], axis=1)


def test_a_seam_is_sewn_by_what_speaks_for_more():
    points = sheet()
    left = points[:, 0] < 7
    mixed = np.outer(np.where(left, -1.0, 1.0), [0.0, 0.0, 1.0])
    around = Neighbourhood(points)
    assert np.array_equal(across_seams(around, mixed, np.ones(len(points))), left)
    assert np.array_equal(across_seams(around, mixed, np.where(left, 1.0, 0.1)), ~left)
    assert not across_seams(around, np.tile([0.0, 0.0, 1.0], (len(points), 1)), np.ones(len(points))).any()


def test_a_sheet_that_ends_at_another_may_change_its_side_there():
    """As where two solids cross."""
    points = sheet()
    wall = np.stack([np.full(len(points), 7.0), points[:, 1] + 0.3, points[:, 0] - 11.7], axis=1)
    both = np.concatenate([points, wall])
    left = points[:, 0] < 7
    mixed = np.concatenate(
        [np.outer(np.where(left, -1.0, 1.0), [0.0, 0.0, 1.0]), np.tile([1.0, 0.0, 0.0], (len(wall), 1))]
    )
    assert not across_seams(Neighbourhood(both), mixed, np.ones(len(both))).any()
