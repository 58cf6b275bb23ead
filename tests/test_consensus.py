"""Planes that many neighbours share: at the foot of walls scanned in rings, and never those of a single ring."""

import numpy as np
import pytest

import face_plugin
from face_plugin.consensus import _best, consensus_lines
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.shapes.scans import ring_rays, scan_boxes
from face_plugin.sides.patches import planes_of, shared_planes


def ringed_street(rings, seed=0):
    """Scan a road between two walls, with two cars, from a sensor of so many rings; 12,000 points."""
    boxes = [
        ((-20.0, -20.0, -1.0), (20.0, 20.0, 0.0)),
        ((-20.0, 5.0, 0.0), (20.0, 6.0, 8.0)),
        ((-20.0, -9.0, 0.0), (8.0, -8.0, 8.0)),
        ((4.0, 1.0, 0.0), (8.0, 2.8, 1.5)),
        ((-9.0, -4.0, 0.0), (-5.0, -2.2, 1.5)),
    ]
    rays = ring_rays(rings, 24_000 // rings)
    return scan_boxes(boxes, [[0.0, 0.0, 1.9]], rays, 12_000, np.random.default_rng(seed), noise=0.005, reach=25.0)


def astray(lines, normals):
    """Share of lines more than 45 degrees off."""
    return float((np.abs(np.einsum("nd,nd->n", lines, normals)) < np.sqrt(0.5)).mean())


@pytest.fixture(scope="module")
def street():
    return ringed_street(32)


@pytest.fixture(scope="module")
def around(street):
    return Neighbourhood(street.points)


@pytest.fixture(scope="module")
def seen(street):
    toward = street.viewpoints[0] - street.points
    return toward / np.linalg.norm(toward, axis=1, keepdims=True)


def test_the_foot_of_a_wall_belongs_to_the_ground_or_to_the_wall(street, around, seen):
    planes = planes_of(around)
    before = astray(planes.lines, street.normals)
    assert before > 0.01
    assert astray(shared_planes(around, planes, seen).lines, street.normals) < 0.5 * before
    assert astray(shared_planes(around, planes).lines, street.normals) < 0.85 * before


def test_a_plane_that_holds_a_line_of_sight_is_no_surface(around, seen):
    lines = planes_of(around).lines
    found = consensus_lines(around, lines, 30, seen)
    new = (found != lines).any(axis=1)
    assert new.sum() > 100
    assert np.abs(np.einsum("nd,nd->n", found, seen))[new].min() >= 0.1


def test_a_single_row_shares_no_plane():
    # A ring that turns from the ground up a wall lies in one plane, with nothing else near.
    step = np.arange(0.0, 6.0, 0.05)
    row = np.concatenate([np.stack([step, 0 * step], axis=1), np.stack([6.0 + 0 * step, step], axis=1)])
    rng = np.random.default_rng(0)
    row = np.column_stack([row, np.zeros(len(row))]) + 0.01 * rng.normal(size=(len(row), 3))
    around = Neighbourhood(row)
    lines = np.tile([1.0, 0.0, 0.0], (len(row), 1))
    np.testing.assert_array_equal(consensus_lines(around, lines, 30), lines)


def test_rough_ground_keeps_its_planes():
    # Everything lies beside a plane as well as on it.
    rng = np.random.default_rng(0)
    ground = np.column_stack([rng.uniform(0, 40, (4000, 2)), rng.normal(size=4000)])
    around = Neighbourhood(ground)
    lines = planes_of(around).lines
    assert (consensus_lines(around, lines, 30) != lines).any(axis=1).mean() < 0.01


def test_the_best_plane_is_that_of_a_slow_count(around):
    lines, near = planes_of(around).lines, around.neighbour
    centre = around.points[near[:, :31]].mean(axis=1)
    rng = np.random.default_rng(0)
    rows = np.sort(rng.choice(len(around), 200, replace=False))
    width, fresh = np.full(200, 0.03), rng.random(len(around)) < 0.5
    score = np.full(200, 5.0)
    found = _best(around.points, rows, near[rows], width, lines, centre, fresh, score)
    for place, i in enumerate(rows):
        best, whose = 5.0, -1
        for j in near[i, 1:]:
            off = (around.points[near[i]] - centre[j]) @ lines[j] / 0.03
            if fresh[j] and abs(off[0]) < 1.0 and np.maximum(1.0 - off**2, 0.0).sum() > best * (1.0 + 1e-12):
                best, whose = np.maximum(1.0 - off**2, 0.0).sum(), j
        assert score[place] == pytest.approx(best)
        assert found[place] == whose


@pytest.mark.parametrize("seed", [0, 1])
def test_a_street_in_rings_faces_its_sensor(seed):
    street = ringed_street(32, seed)
    normals = face_plugin.estimate_normals(street.points, viewpoints=street.viewpoints).normals
    right = np.einsum("nd,nd->n", normals, street.normals)
    assert (right > 0).mean() > 0.999
    # 0.0044 and 0.0047 by planes through the nearest points.
    assert astray(normals, street.normals) < 0.003
