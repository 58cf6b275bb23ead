"""Scans of several rooms, merged and thinned to a grid, as surveys come: density and single places tell no side."""

import numpy as np
import pytest

from face_plugin import estimate_normals
from face_plugin.shapes.scans import scan_boxes, sphere_rays

WIDTH, DEPTH, HEIGHT, THICK = 8.0, 6.0, 2.6, 0.06
OUTER = [
    ((-1, -1, -1), (9, 7, 0)),
    ((-1, -1, HEIGHT), (9, 7, 3)),
    ((-1, -1, 0), (0, 7, HEIGHT)),
    ((WIDTH, -1, 0), (9, 7, HEIGHT)),
    ((0, -1, 0), (WIDTH, 0, HEIGHT)),
    ((0, DEPTH, 0), (WIDTH, 7, HEIGHT)),
]
# With doors between the four rooms.
WALLS = [((4 - THICK, y, 0), (4 + THICK, end, HEIGHT)) for y, end in ((0, 1), (1.9, 4.2), (5.1, DEPTH))]
WALLS += [((x, 3 - THICK, 0), (end, 3 + THICK, HEIGHT)) for x, end in ((0, 2.2), (3.1, 5.5), (6.4, WIDTH))]
STANDS = [
    ((0.1, 0.1, 0), (0.7, 2.1, 0.8)),
    ((1.5, 1.2, 0), (2.5, 1.9, 0.75)),
    ((5.0, 0.2, 0), (7.0, 1.1, 0.45)),
    ((0.2, 4.0, 0), (2.2, 5.6, 0.5)),
    ((5.2, 4.2, 0), (6.4, 5.4, 0.75)),
    ((7.2, 4.0, 0), (7.9, 5.5, 0.9)),
]
PLACES = np.array([(2.0, 2.0, 1.4), (6.0, 1.8, 1.5), (2.9, 4.5, 1.4), (5.0, 5.0, 1.5)])


@pytest.fixture(scope="module")
def rooms():
    rng = np.random.default_rng(0)
    scan = scan_boxes(OUTER + WALLS + STANDS, PLACES, sphere_rays(6000), 20_000, rng, noise=0.003)
    cell = np.unique(np.floor(scan.points / 0.1), axis=0, return_index=True)[1]
    return scan.points[cell], scan.normals[cell]


def test_nothing_is_lost_and_it_is_said_what_to_give(rooms, caplog):
    # Free space gets through the shadows of what stands there: what seems to lie inside is not enclosed.
    assert not estimate_normals(rooms[0], filter_interior=True).interior.any()
    assert "give its viewpoints" in caplog.text


def test_with_viewpoints_all_face_inward(rooms):
    points, normals = rooms
    found = estimate_normals(points, viewpoints=PLACES, filter_interior=True)
    assert ((found.normals * normals).sum(axis=1) > 0).mean() > 0.985
    assert not found.interior.any()
