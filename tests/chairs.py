"""A chair of boxes as cameras around it see it: legs of a few points, and ground between them."""

import numpy as np
from scipy.spatial.transform import Rotation

from face_plugin.shapes.scans import camera_rays, scan_boxes

MIDDLE = np.array([0.0, 0.0, 0.5])
SEAT = [((-0.2, -0.2, 0.42), (0.25, 0.25, 0.46)), ((-0.2, 0.21, 0.44), (0.25, 0.25, 0.95))]
LEGS = [((x, y, 0.0), (x + 0.04, y + 0.04, 0.44)) for x in (-0.2, 0.21) for y in (-0.2, 0.21)]
GROUND = [((-1.5, -1.5, -0.1), (1.5, 1.5, 0.0))]


def scan_chair(views, height, each, *, ground=False, turned=0.0, seed=0):
    """Points (n, 3), normals (n, 3) and viewpoints (views, 3); views are turned about the middle by so many degrees."""
    rng, points, normals, places = np.random.default_rng(seed), [], [], []
    for turn in np.linspace(0.0, 2.0 * np.pi, views, endpoint=False):
        place = np.array([1.6 * np.cos(turn), 1.6 * np.sin(turn), height + 0.3 * np.sin(3.0 * turn)])
        rays = camera_rays(200, 200, MIDDLE - place, 50.0)
        scan = scan_boxes(SEAT + LEGS + GROUND * ground, [place], rays, each, rng, noise=0.002, reach=3.5)
        wrong = Rotation.from_rotvec(np.radians(turned) * rng.normal(size=3))
        points.append(wrong.apply(scan.points - MIDDLE) + MIDDLE)
        normals.append(wrong.apply(scan.normals))
        places.append(place)
    return np.concatenate(points), np.concatenate(normals), np.array(places)
