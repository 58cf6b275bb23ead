"""What sensors saw, and which of many viewpoints are looked from."""

import numpy as np
import pytest

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.shapes import sphere
from face_plugin.sides.sensors import MOST_VIEWPOINTS, Sensors
from face_plugin.sides.sights import sights, visible

BALL = sphere(2000).points


def test_what_is_seen_does_not_depend_on_what_else_is_asked():
    around, view = Neighbourhood(BALL), np.array([0.0, 0.5, 5.0])
    asked = np.random.default_rng(0).random(len(BALL)) < 0.3
    whole, some = (visible(BALL, around.spacing, view, BALL, of) for of in (None, asked))
    assert whole.sum() > 500
    np.testing.assert_array_equal(some, whole & asked)
    whole, some = (sights(around, Sensors([view, -view]), BALL, of) for of in (None, asked))
    np.testing.assert_array_equal(some, np.where(asked[:, None], whole, 0.0))


def test_of_a_long_trajectory_what_passes_a_part_is_looked_from():
    drive = Sensors(np.column_stack([np.arange(1000.0), np.zeros((1000, 2))]))
    part = np.column_stack([np.linspace(300.0, 340.0, 500), np.full(500, 8.0), np.zeros(500)])
    views = np.asarray(drive.about(part).viewpoints)[:, 0]
    np.testing.assert_array_equal(views, np.arange(300.0, 341.0))


@pytest.mark.parametrize(
    "sensors",
    [
        Sensors(np.arange(3.0 * MOST_VIEWPOINTS).reshape(-1, 3)),
        Sensors(np.arange(300.0).reshape(-1, 3), seen_from=np.array([4, 2, -1])),
        Sensors(up=[0.0, 0.0, 1.0]),
    ],
)
def test_few_viewpoints_and_known_rows_are_kept_whole(sensors):
    assert sensors.about(np.zeros((3, 3))) is sensors
