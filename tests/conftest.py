"""Solved cages that several files of tests look at; solving is what takes time."""

from __future__ import annotations

import pytest

from face_plugin import FaCE, shapes
from face_plugin.shapes import Shape


@pytest.fixture(scope="session")
def demo() -> Shape:
    """Give a teapot of crossing parts with a box left inside."""
    return shapes.demo_shape(1500, 0)


@pytest.fixture(scope="session")
def demo_face(demo: Shape) -> FaCE:
    return FaCE(demo.points)


@pytest.fixture(scope="session")
def ball() -> Shape:
    return shapes.sphere(300, 0)


@pytest.fixture(scope="session")
def ball_face(ball: Shape) -> FaCE:
    return FaCE(ball.points)
