"""Balls in a box for the tests of the meshers."""

import numpy as np

from face_plugin import shapes
from face_plugin.faraday import domain
from face_plugin.faraday.balls import build_balls
from face_plugin.geometry import local_spacing

BALL = shapes.sphere(150)


def caged(points, solid="octahedron", radius=0.45, padding=0.1):
    points = points / np.linalg.norm(np.ptp(points, axis=0))
    balls = build_balls(points, np.arange(len(points)), radius=radius, solid=solid)
    return balls, local_spacing(points), domain.padded_box(balls, padding)
