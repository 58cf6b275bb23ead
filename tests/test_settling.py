"""A place that is only a guess does not tear what the points themselves hold together."""

import numpy as np
import pytest

from face_plugin import estimate_normals
from face_plugin.shapes.scans import camera_rays, scan_boxes
from face_plugin.sides.graph import Edges
from face_plugin.sides.settling import settled_signs


def chair_on_ground():
    """Five low cameras around a chair, on ground."""
    boxes = [
        ((-1.5, -1.5, -0.1), (1.5, 1.5, 0.0)),
        ((0.0, 0.0, 0.42), (0.45, 0.45, 0.46)),
        ((0.0, 0.41, 0.44), (0.45, 0.45, 0.95)),
    ]
    boxes += [((x, y, 0.0), (x + 0.04, y + 0.04, 0.44)) for x in (0.0, 0.41) for y in (0.0, 0.41)]
    boxes = [
        (np.subtract(low, (0.2, 0.2, 0.0)), np.subtract(high, (0.2, 0.2, 0.0))) for low, high in boxes[1:]
    ] + boxes[:1]
    rng, scans = np.random.default_rng(0), []
    for turn in np.linspace(0.0, 2.0 * np.pi, 5, endpoint=False):
        place = np.array([1.6 * np.cos(turn), 1.6 * np.sin(turn), 0.4 + 0.3 * np.sin(3.0 * turn)])
        rays = camera_rays(200, 200, np.array([0.0, 0.0, 0.5]) - place, 50.0)
        scans.append(scan_boxes(boxes, [place], rays, 2400, rng, noise=0.002, reach=3.5))
    return np.concatenate([scan.points for scan in scans]), np.concatenate([scan.normals for scan in scans])


def test_a_chair_is_on_the_side_of_its_ground():
    points, normals = chair_on_ground()
    found = estimate_normals(points, filter_interior=True)
    right = ((found.normals * normals).sum(axis=1) > 0).mean()
    assert max(right, 1.0 - right) > 0.98
    assert found.interior.mean() < 0.002


@pytest.mark.parametrize(("seen", "turned"), [(-0.1, False), (-0.9, True)])
def test_what_is_seen_of_a_part_is_weighed_against_its_border(seen, turned):
    # Two chains; the second is joined to the first by one edge that says 0.5 of what an edge can.
    edges = Edges(np.arange(99), np.arange(1, 100))
    coupling = np.where(np.arange(99) == 49, 0.075, 0.9)
    faces = np.where(np.arange(100) < 50, 1.0, seen)
    joined = np.ones(100)
    assert (settled_signs(edges, coupling, faces, joined)[50:] < 0).all() == turned
    # The sums are in favour of turning both times: fifty points against one edge.
    assert -50 * 0.5 * seen > coupling[49]
