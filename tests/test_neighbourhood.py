"""What is near each point: right, and found once for all steps."""

import numpy as np

from face_plugin import FaCE, neighbourhood, shapes
from face_plugin.geometry import local_spacing
from face_plugin.neighbourhood import Neighbourhood

BALL = shapes.sphere(600, 0)


def test_neighbours_spacing_and_areas():
    around = Neighbourhood(BALL.points)
    assert around.distance.shape == around.neighbour.shape == (600, 97)
    np.testing.assert_array_equal(around.neighbour[:, 0], np.arange(600))
    np.testing.assert_array_equal(around.spacing, local_spacing(BALL.points))
    np.testing.assert_array_equal(around.tree.areas, around.spacing**2)


def test_few_points_have_fewer_neighbours():
    assert Neighbourhood(BALL.points[:5]).neighbour.shape == (5, 5)


def test_a_cloud_is_searched_once_for_all_steps(monkeypatch):
    searched, planted = [], []

    class Tree(neighbourhood.PointTree):
        def nearest(self, count):
            searched.append(len(self.points))
            return super().nearest(count)

    class Dipoles(neighbourhood.DipoleTree):
        def __init__(self, tree, areas):
            planted.append(len(areas))
            super().__init__(tree, areas)

    monkeypatch.setattr(neighbourhood, "PointTree", Tree)
    monkeypatch.setattr(neighbourhood, "DipoleTree", Dipoles)
    FaCE(BALL.points).result(filter_interior=True)
    # The second search is among the few points that show sheets far away.
    assert searched.count(600) == 1
    assert planted == [600]
