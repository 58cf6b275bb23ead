"""What is seen from a place that is a guess, against what the points themselves hold together."""

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


def two_chains(between):
    """Edges and couplings of two chains of fifty points, of which the second is joined to the first by one edge."""
    edges = Edges(np.arange(99), np.arange(1, 100))
    return edges, np.where(np.arange(99) == 49, between, 0.9)


@pytest.mark.parametrize(("seen", "turned"), [(-0.1, False), (-0.9, True)])
def test_what_is_seen_of_a_part_is_weighed_against_its_border(seen, turned):
    # The edge says 0.5 of what an edge can.
    edges, coupling = two_chains(0.075)
    faces = np.where(np.arange(100) < 50, 1.0, seen)
    assert (settled_signs(edges, coupling, faces, np.ones(100))[0][50:] < 0).all() == turned
    # The sums are in favour of turning both times: fifty points against one edge.
    assert -50 * 0.5 * seen > coupling[49]


@pytest.mark.parametrize(("seen", "every", "turned"), [(-0.1, 2, False), (-0.9, 18, True), (-0.3, 2, True)])
def test_little_that_is_seen_at_a_slant_was_seen_through_gaps(seen, every, turned):
    edges, coupling = two_chains(0.003)
    faces = np.where(np.arange(100) < 50, 1.0, np.where(np.arange(100) % every == 0, seen, 0.0))
    assert (settled_signs(edges, coupling, faces, np.ones(100))[0][50:] < 0).all() == turned
    assert -0.5 * faces[50:].sum() > coupling[49]


def test_a_place_is_worth_less_by_what_it_tears():
    faces = np.where(np.arange(100) < 50, 1.0, -0.8)
    sign, worth = settled_signs(*two_chains(0.075), faces, np.ones(100))
    # 0.9 of the points' sights; two of the unit of couplings are four of sights.
    assert (sign[50:] < 0).all()
    assert worth == pytest.approx(0.9 - 4 * 0.075 / 100)
    assert settled_signs(*two_chains(0.075), np.abs(faces), np.ones(100))[1] == pytest.approx(0.9)
