"""Points in the plane: sides and angles of curves, what is interior, and what is refused."""

import numpy as np
import pytest

from face_plugin import FaCE, Params, estimate_normals, orient_normals, reconstruct
from face_plugin.cloud import prepare
from face_plugin.faraday.field import strength_exact
from face_plugin.faraday.triangles import shape_gradients, triangle_stiffness
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.shapes import curves, with_noise
from face_plugin.shapes.curves import circle, gear, letter, nested_circles, spiral, star, two_circles
from face_plugin.sides.strays import find_strays
from face_plugin.winding_plane import PlaneTree


def facing(shape, result):
    return np.einsum("nd,nd->n", result.normals, shape.normals)


def angle(cosine):
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean()


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize(
    ("curve", "count", "degrees"),
    [(circle, 100, 0.5), (star, 300, 1.6), (star, 2000, 0.3), (gear, 3000, 1.0), (letter, 1000, 1.0)],
)
def test_closed_curves_point_outward(curve, count, degrees, even):
    shape = curve(count, even=even)
    cosine = facing(shape, estimate_normals(shape.points))
    assert (cosine > 0).mean() >= 0.999
    assert angle(cosine) < degrees


@pytest.mark.parametrize("curve", [circle, star, letter])
def test_noise_of_half_a_spacing(curve):
    shape = curve(2000, even=False)
    spacing = np.median(Neighbourhood(shape.points).spacing) / 2
    noisy = with_noise(shape, 0.5 * spacing)
    cosine = facing(shape, estimate_normals(noisy.points))
    assert (cosine > 0).mean() >= 0.995
    assert angle(cosine) < 2.0


@pytest.mark.parametrize("slot", [0.02, 0.04])
def test_narrow_slots_are_right_inside(slot):
    # No field gets to their ends: the curve is followed there.
    shape = letter(3000, slot=slot)
    assert (facing(shape, estimate_normals(shape.points)) > 0).mean() >= 0.999


@pytest.mark.parametrize("apart", [0.02, 0.04])
def test_two_layers_a_few_points_apart(apart):
    one, other = star(400, 1), star(400, 2)
    points = np.concatenate([one.points, other.points * (1 + apart)])
    result = estimate_normals(points, filter_interior=True)
    cosine = np.einsum("nd,nd->n", result.normals, np.concatenate([one.normals, other.normals]))
    assert (cosine > 0).mean() >= 0.99


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("curve", [two_circles, nested_circles])
def test_what_lies_within_is_interior(curve, even):
    shape = curve(1000, even=even)
    result = estimate_normals(shape.points, filter_interior=True)
    assert not result.interior[~shape.interior].any()
    assert result.interior[shape.interior].mean() > 0.95
    assert (facing(shape, result) > 0).mean() >= 0.999


def test_a_ring_with_a_hole():
    shape = nested_circles(400)
    result = estimate_normals(shape.points, Params(nested="cavity"), filter_interior=True)
    assert ((facing(shape, result) < 0) == shape.interior).all()
    assert not result.interior.any()


@pytest.mark.parametrize("even", [True, False])
def test_an_open_spiral_has_one_side(even):
    shape = spiral(1000, even=even)
    cosine = facing(shape, estimate_normals(shape.points))
    assert np.abs(np.sign(cosine).mean()) == 1.0


def test_results_are_as_in_space():
    shape = star(400)
    points = np.concatenate([shape.points, shape.points[:7]]).astype(np.float32)
    result = estimate_normals(points, filter_interior=True)
    assert result.normals.shape == (407, 2)
    assert result.normals.dtype == result.strength.dtype == result.confidence.dtype == np.float32
    np.testing.assert_array_equal(result.normals[:7], result.normals[400:])
    np.testing.assert_allclose(np.linalg.norm(result.normals, axis=1), 1.0, atol=1e-6)
    np.testing.assert_array_equal(estimate_normals(points).normals, result.normals)
    # The order of the points is no matter.
    order = np.random.default_rng(0).permutation(407)
    np.testing.assert_array_equal(estimate_normals(points[order]).normals, result.normals[order])


def test_normals_turn_with_the_points():
    points = star(400, arms=3).points * [1.0, 0.7]
    normals = estimate_normals(points).normals
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    moved = estimate_normals(123.0 * points @ turn.T + [4e3, -7e2]).normals
    np.testing.assert_allclose(moved, normals @ turn.T, atol=1e-6)


def test_the_field_alone():
    shape = circle(200)
    for params in (
        Params(angles="field"),
        Params.paper(mesher="delaunay"),
        Params(cage_spacing=0.2),
    ):
        result = estimate_normals(shape.points, params, filter_interior=True)
        assert (facing(shape, result) > 0).all()
        assert not result.interior.any()


def test_field_at_any_position():
    face = FaCE(circle(300).points)
    inside, outside = face.strength(np.array([[0.0, 0.1], [9.0, 9.0]]))
    assert inside < 1e-6
    assert outside == 1.0
    ball = face.frame.from_unit(face.balls.centres[:3])
    np.testing.assert_allclose(face.strength(ball), face._reading.seen.strength[face.balls.points[:3]])


def test_signs_of_given_normals():
    shape = letter(800)
    mixed = shape.normals * np.where(np.random.default_rng(0).random(800) < 0.5, 3.0, -3.0)[:, None]
    np.testing.assert_array_equal(orient_normals(shape.points, mixed), 3.0 * shape.normals)
    with pytest.raises(ValueError, match=r"normals must be \(800, 2\) numbers"):
        orient_normals(shape.points, np.ones((800, 3)))


@pytest.mark.parametrize("count", range(4, 13))
def test_few_points(count):
    shape = circle(count)
    cosine = facing(shape, estimate_normals(shape.points, filter_interior=True))
    assert (cosine > 0.5).all()


def test_strays_are_set_aside():
    points = np.concatenate([circle(500, even=False).points, [[3.0, 0.0], [0.0, 2.5]]])
    assert np.flatnonzero(find_strays(Neighbourhood(points))).tolist() == [500, 501]
    assert not find_strays(Neighbourhood(circle(5000, even=False).points)).any()


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"viewpoints": [[0.0, 0.0, 1.0]]}, "viewpoints"),
        ({"viewpoints": [[0.0, 0.0]]}, "viewpoints"),
        ({"up": [0.0, 1.0]}, "up"),
        ({"sculpt": "cavity.json"}, "sculpt"),
    ],
)
def test_what_only_space_has_is_refused(options, name):
    with pytest.raises(ValueError, match=rf"{name} serves points in space, .* leave it out in the plane"):
        estimate_normals(circle(50).points, **options)


def test_no_surface_and_no_edits():
    points = circle(50).points
    with pytest.raises(ValueError, match=r"points must have the shape \(n, 3\), found \(50, 2\); in the plane"):
        reconstruct(points)
    with pytest.raises(ValueError, match="charges serves points in space"):
        FaCE(points).add_charges([[0.0, 0.0]])
    with pytest.raises(ValueError, match="mesher must be 'auto' or 'delaunay' for points in the plane"):
        estimate_normals(points, Params(mesher="tetgen"))


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((9, 2)), "points must be distinct"),
        (np.outer(np.arange(9.0), [1.0, 2.0]), "points must not all lie on one line"),
        (np.full((9, 2), np.nan), "points must be finite"),
        (np.ones((2, 9)), r"found \(2, 9\); transpose it"),
        (np.eye(2), "points must hold at least 4 points"),
    ],
)
def test_bad_input_is_named(points, message):
    with pytest.raises(ValueError, match=message):
        prepare(points)


def test_stiffness_of_a_right_triangle():
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    triangle = np.array([[0, 1, 2]], dtype=np.int32)
    rows = triangle_stiffness(corners, triangle, np.arange(3), 3, 3).toarray()
    # Half the cotangents of the opposite angles, with the minus sign.
    np.testing.assert_allclose(rows, [[1.0, -0.5, -0.5], [-0.5, 0.5, 0.0], [-0.5, 0.0, 0.5]], atol=1e-15)
    np.testing.assert_allclose(shape_gradients(corners, triangle)[0].sum(axis=1), 0.0, atol=1e-15)


def test_strength_is_the_largest_singular_value():
    gradients = np.random.default_rng(0).normal(size=(50, 2, 2))
    np.testing.assert_allclose(strength_exact(gradients), np.linalg.svd(gradients, compute_uv=False)[:, 0])


def test_winding_number_is_the_sum():
    rng = np.random.default_rng(0)
    points, normals = rng.normal(size=(300, 2)), rng.normal(size=(300, 2))
    order = np.argsort(points[:, 0])
    points, width = points[order], np.full(300, 0.1)
    tree = PlaneTree(points, np.ones(300))
    offset = points[None] - points[:, None]
    squared = (offset**2).sum(axis=2) + 0.01
    along = np.einsum("jd,ijd->ij", normals, offset)
    exact = (along / squared).sum(axis=1) / (2 * np.pi)
    np.testing.assert_allclose(tree.number(normals, width, opening=0.0), exact, atol=1e-12)
    gradient = normals[None] / squared[..., None] - 2 * (along / squared**2)[..., None] * offset
    # A point leaves itself out.
    gradient[np.arange(300), np.arange(300)] = 0.0
    np.testing.assert_allclose(tree.outward(normals, width, opening=0.0), 2 * gradient.sum(axis=1), atol=1e-9)


@pytest.mark.parametrize(("arguments", "message"), [(([], 5), "curves: found none"), (([np.eye(2)], 0), "n: found 0")])
def test_curves_of_nothing(arguments, message):
    with pytest.raises(ValueError, match=message):
        curves.along(*arguments)
