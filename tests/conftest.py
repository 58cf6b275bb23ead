"""What several files of tests look at: solved cages, for solving is what takes time, and the viewer on one of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from face_plugin import FaCE, shapes
from face_plugin.shapes import Shape

if TYPE_CHECKING:
    from viewing import Hand

    from face_plugin.app.viewer.session import Session


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


@pytest.fixture(scope="session")
def mug() -> Session:
    """Give a mug in the viewer."""
    from face_plugin.app.viewer.session import Session

    return Session(shapes.cup(1500, depth=1.5).points)


@pytest.fixture
def session(mug: Session) -> Session:
    """Give the mug as it was when it was opened."""
    from face_plugin.app.viewer.session import Plane

    mug.mode, mug.plane, mug.alpha = "look", Plane(), 0.01
    while mug.face.edits:
        mug.undo()
    return mug


@pytest.fixture
def hand(session: Session, tmp_path: Path) -> Hand:
    """Give a mouse on the mug, which needs Polyscope."""
    from viewing import Hand

    return Hand(session, tmp_path)
