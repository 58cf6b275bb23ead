"""Scans that were thinned to a grid, as most scripts do first: density then tells nothing of where scanners stood."""

import numpy as np
import pytest

from face_plugin import estimate_normals
from face_plugin.shapes.scans import ring_rays, scan_boxes

LONG = 30.0


def scan_street(seed, rings, cell):
    """Scan a street of houses and cars from four places, and keep a point of each cell: points and normals (n, 3)."""
    rng = np.random.default_rng(seed)
    boxes = [((-LONG, -LONG, -1.0), (LONG, LONG, 0.0))]
    for side in (1, -1):
        x = -LONG
        while x < LONG:
            wide, front, high = rng.uniform(5, 11), rng.uniform(6, 8), rng.uniform(5, 10)
            y = np.sort(side * np.array([front, front + 8]))
            boxes.append(((x, y[0], 0.0), (x + wide, y[1], high)))
            x += wide + rng.choice([0, 0, 2])
    for x, y in zip(rng.uniform(-15, 15, 4), rng.choice([-3.5, 3.5], 4), strict=True):
        boxes.append(((x, y - 0.9, 0.0), (x + 4.2, y + 0.9, 1.5)))
    places = np.array([(x, 0.0, 2.0) for x in (-12.0, -4.0, 4.0, 12.0)])
    scan = scan_boxes(boxes, places, ring_rays(rings, 900), 30_000, rng, noise=0.01)
    kept = np.unique(np.floor(scan.points / cell), axis=0, return_index=True)[1]
    return scan.points[kept], scan.normals[kept]


@pytest.mark.parametrize(("seed", "rings", "cell"), [(0, 16, 0.6), (2, 16, 0.6), (4, 16, 0.9)])
def test_no_scanner_is_believed_to_have_stood_below_the_ground(seed, rings, cell):
    points, normals = scan_street(seed, rings, cell)
    right = ((estimate_normals(points).normals * normals).sum(axis=1) > 0).mean()
    assert max(right, 1.0 - right) > 0.99
