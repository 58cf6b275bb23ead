"""Which points lie inside the object: against the truth of generated solids."""

from __future__ import annotations

import numpy as np
import pytest

from face_plugin import FaCE, Params, shapes
from face_plugin.geometry import local_spacing
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.enclosure import automatic_alpha, enclosed

SOLIDS = {
    "box in a sphere": lambda: shapes.nested_box(4000, 0),
    "crossed cylinders": lambda: shapes.crossed_cylinders(4000, 0),
    "shelves in a box": lambda: shapes.shelves(6000, 0),
    "two spheres": lambda: shapes.two_spheres(4000, 0),
    "legs, lid, spout and handle in a teapot": lambda: shapes.teapot(10000, 0),
    "the same with a box": lambda: shapes.demo_shape(6000, 0),
    "the same again": lambda: shapes.demo_shape(6000, 2),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_points_deeper_than_two_spacings_are_found_and_no_others(name):
    shape = SOLIDS[name]()
    found = FaCE(shape.points).interior()
    spacing = np.median(local_spacing(shape.points))
    deep = shape.interior & (shape.depth > 2 * spacing)
    surface = ~shape.interior
    recall = found[deep].mean()
    precision = (found & deep).sum() / (found & (deep | surface)).sum()
    assert recall >= 0.99
    assert precision >= 0.99


def test_a_doubled_shell_loses_no_point_of_its_outer_layer():
    shell = shapes.doubled_shell(4000, 0)
    found = FaCE(shell.points).interior()
    assert found[~shell.interior].mean() < 0.01
    # What is buried by a spacing or less counts as scatter of the surface.
    deep = shell.interior & (shell.depth > 1.5 * np.median(local_spacing(shell.points)))
    assert found[deep].mean() >= 0.99


@pytest.mark.parametrize("make", [shapes.sphere, shapes.torus, shapes.bowl, shapes.box])
def test_nothing_is_dropped_where_nothing_is_inside(make):
    # At most one point in a thousand.
    assert FaCE(make(3000, 0).points).interior().mean() <= 0.001


def test_a_fixed_alpha_is_the_papers_rule_and_solves_nothing_again():
    cup = shapes.cup(2500, 0, depth=1.5, thickness=0.3)
    face = FaCE(cup.points)
    solved = face.timings["poisson"]
    shielded = face.interior("sparse").mean()
    # A shielded dent counts as inside for the paper, and not for "auto".
    assert shielded > 0.02
    assert face.interior("auto").mean() < 0.25 * shielded
    assert face.interior(0.05).mean() == shielded
    assert face.timings["poisson"] == solved


def test_both_inside_tests_say_the_same():
    points = shapes.demo_shape(2500, 0).points
    rays = FaCE(points, Params(alpha=0.01)).interior()
    winding = FaCE(points, Params(alpha=0.01, inside="winding")).interior()
    assert (rays == winding).mean() >= 0.9995


def test_alpha_follows_the_leak_within_bounds():
    assert automatic_alpha(np.empty(0)) == 0.03
    assert automatic_alpha(np.full(3, 0.2)) == pytest.approx(0.2)
    assert automatic_alpha(np.full(3, 0.9)) == 0.3


def test_the_resolved_alpha_stands_in_the_result():
    result = FaCE(shapes.nested_box(1500, 0).points).result(filter_interior=True)
    assert isinstance(result.params.alpha, float)


def test_what_lies_inside_does_not_blur_what_is_enclosed():
    nested = shapes.nested_box(3000, 0)
    strength = np.where(nested.interior, 0.0, 1.0)
    # Whatever way the points inside face: the random sides that a sealed cage leaves them with.
    sides = np.where(nested.interior & (np.random.default_rng(0).random(len(strength)) < 0.5), -1.0, 1.0)
    found = enclosed(Neighbourhood(nested.points), nested.normals * sides[:, None], strength)
    assert (found == nested.interior).all()


def test_a_crease_is_not_enclosed():
    # A V-shaped notch: the winding number rises towards its bottom, as the angle closes.
    side = np.linspace(0.0, 1.0, 30)
    u, v = (x.ravel() for x in np.meshgrid(side, side))
    slope = np.radians(20)
    right = np.stack([u * np.sin(slope), v, u * np.cos(slope)], axis=1)[u > 0]
    left = right * [-1, 1, 1]
    normal = np.array([-np.cos(slope), 0.0, np.sin(slope)])
    points = np.concatenate([right, left])
    normals = np.concatenate([np.tile(normal, (len(right), 1)), np.tile(normal * [-1, 1, 1], (len(left), 1))])
    assert not enclosed(Neighbourhood(points), normals, np.ones(len(points))).any()


def test_an_unknown_name_is_refused():
    with pytest.raises(ValueError, match="alpha"):
        FaCE(shapes.sphere(200, 0).points).interior("thick")
