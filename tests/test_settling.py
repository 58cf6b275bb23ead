"""What is seen from a place, of little of many points, against what the points themselves hold together."""

import numpy as np
import pytest
from chairs import scan_chair

from face_plugin import estimate_normals
from face_plugin.sides.graph import Edges
from face_plugin.sides.settling import settled_signs


def right(found, normals):
    return ((found.normals * normals).sum(axis=1) > 0).mean()


def test_a_chair_is_on_the_side_of_its_ground():
    points, normals, _ = scan_chair(5, 0.4, 2400, ground=True)
    found = estimate_normals(points, filter_interior=True)
    assert max(right(found, normals), 1.0 - right(found, normals)) > 0.98
    assert found.interior.mean() < 0.002


def test_viewpoints_leave_the_normals_of_thin_legs_as_good_as_without():
    points, normals, viewpoints = scan_chair(8, 1.0, 1000, turned=1.0)
    with_them, without = (right(estimate_normals(points, viewpoints=of), normals) for of in (viewpoints, None))
    assert with_them > without - 0.001
    assert with_them > 0.993


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
