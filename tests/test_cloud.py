import logging

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from face_plugin import cloud

GOOD = np.random.default_rng(0).normal(size=(60, 3)) * [3.0, 2.0, 1.0] + np.random.default_rng(1).random((60, 3)) ** 4


def broken(row, value):
    points = GOOD.copy()
    points[row] = value
    return points


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([], r"points must have the shape \(n, 3\) or \(n, 2\), found \(0,\)"),
        (np.empty((0, 3)), "points must hold at least 4 points, found 0"),
        (GOOD[:3], "points must hold at least 4 points, found 3"),
        (GOOD[:, :1], r"points must have the shape \(n, 3\) or \(n, 2\), found \(60, 1\)$"),
        (GOOD.T, r"found \(3, 60\); transpose it"),
        (GOOD[None], r"found \(1, 60, 3\)"),
        (5.0, r"found \(\)"),
        (None, "points must hold real numbers, found dtype object"),
        ("points.ply", "points must hold real numbers, found dtype <U10"),
        (GOOD + 0j, "points must hold real numbers, found dtype complex128"),
        ([[0, 0, 0], [1, 0]], "points must be an .* of numbers"),
        (broken(7, np.nan), "points must be finite, found NaN or infinity in 1 of 60 rows: 7$"),
        (broken(slice(3, 12), np.inf), "in 9 of 60 rows: 3, 4, 5, 6, 7, ...$"),
        (np.ones((50, 3)), "points must be distinct, found 50 points at one place"),
        (np.repeat(GOOD[:3], 9, axis=0), "points must hold at least 4 distinct points, found 3 among 27"),
        (np.outer(np.arange(9.0), [1, 2, 3]), "points must not all lie on one line"),
        (np.outer(np.linspace(0, 1, 9), [1, 2, 3]) + 1e6, "points must not all lie on one line"),
        (np.outer(np.linspace(0, 1, 9), [1, 2, 3]).astype(np.float32), "points must not all lie on one line"),
        (GOOD[:2].repeat(4, axis=0), "points must not all lie on one line"),
        (
            np.array([[-1.7e308] * 3, [1.7e308] * 3, [0, 1e308, 0], [0, 0, 1]]),
            "points must span a finite length",
        ),
    ],
)
def test_bad_input_is_named(points, message):
    with pytest.raises(ValueError, match=message):
        cloud.prepare(points)


def test_name_of_the_argument_is_in_the_message():
    with pytest.raises(ValueError, match=r"^query must be finite"):
        cloud.as_points([[np.nan, 0, 0]], "query")


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("float64", "float64"),
        ("float32", "float32"),
        ("float16", "float32"),
        ("int32", "float64"),
        ("uint8", "float64"),
        (">f8", "float64"),
        ("longdouble", "float64"),
    ],
)
def test_types_of_numbers(given, kept):
    points = np.arange(15).reshape(5, 3).astype(given)
    converted = cloud.as_points(points)
    assert converted.dtype == kept
    np.testing.assert_array_equal(converted, np.arange(15).reshape(5, 3))


def test_lists_views_and_read_only_arrays_are_equal_to_plain_ones():
    expected = cloud.prepare(GOOD).points
    wide = np.zeros((60, 7))
    wide[:, 1:6:2] = GOOD
    frozen = GOOD.copy()
    frozen.setflags(write=False)
    for same in (GOOD.tolist(), wide[:, 1:6:2], np.asfortranarray(GOOD), GOOD[::-1][::-1], frozen):
        np.testing.assert_array_equal(cloud.prepare(same).points, expected)


def test_input_is_not_changed():
    points = GOOD.copy()
    cloud.prepare(points)
    np.testing.assert_array_equal(points, GOOD)


def test_frame_goes_both_ways():
    found = cloud.prepare(GOOD)
    np.testing.assert_allclose(found.frame.from_unit(found.points[found.rows]), GOOD, atol=1e-14)
    np.testing.assert_allclose(found.frame.to_unit(GOOD), found.points[found.rows], atol=1e-15)
    np.testing.assert_allclose(found.frame.rotation @ found.frame.rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(found.frame.rotation) == pytest.approx(1.0)
    vectors = np.random.default_rng(2).normal(size=(5, 3))
    np.testing.assert_allclose(found.frame.unrotate(found.frame.rotate(vectors)), vectors, atol=1e-14)


def test_canonical_points_have_unit_size():
    points = cloud.prepare(GOOD * 1e5 - 1e7).points
    assert np.linalg.norm(np.ptp(points, axis=0)) == pytest.approx(1.0)
    np.testing.assert_allclose(points.min(axis=0), -points.max(axis=0), atol=1e-14)


@pytest.mark.parametrize("scale", [1e-300, 1e-6, 1e6, 1e300])
def test_scale_and_place_do_not_matter(scale):
    expected = cloud.prepare(GOOD).points
    np.testing.assert_allclose(cloud.prepare(GOOD * scale).points, expected, atol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_rotation_does_not_matter_where_principal_axes_are_distinct(seed):
    expected = cloud.prepare(GOOD)
    turned = cloud.prepare(Rotation.random(random_state=seed).apply(GOOD))
    np.testing.assert_allclose(turned.points[turned.rows], expected.points[expected.rows], atol=1e-14)


def test_order_and_repetition_do_not_matter():
    expected = cloud.prepare(GOOD)
    rng = np.random.default_rng(3)
    picked = np.concatenate([rng.permutation(60), rng.integers(60, size=200), np.full(10_000, 17)])
    found = cloud.prepare(GOOD[picked])
    np.testing.assert_array_equal(found.points, expected.points)
    np.testing.assert_array_equal(found.rows, expected.rows[picked])
    assert found.size == len(picked)


def test_points_that_nearly_coincide_are_merged_across_borders_of_cells():
    lattice = np.stack(np.meshgrid(*3 * [np.arange(9.0)]), axis=-1).reshape(-1, 3)
    twins = lattice + 1e-12 * np.random.default_rng(0).normal(size=lattice.shape)
    found = cloud.prepare(np.concatenate([lattice, twins]))
    assert len(found.points) == len(lattice)
    np.testing.assert_array_equal(found.rows[: len(lattice)], found.rows[len(lattice) :])
    assert len(np.unique(found.rows)) == len(lattice)


def test_near_points_that_are_distinct_are_kept():
    twins = np.concatenate([GOOD, GOOD + 1e-7])
    assert len(cloud.prepare(twins).points) == 120


@pytest.mark.parametrize(
    "points",
    [
        GOOD * [1, 1, 0],
        Rotation.from_euler("xyz", [1, 2, 3]).apply(GOOD * [1, 1, 0]),
        Rotation.from_euler("xyz", [1, 2, 3]).apply(GOOD * [1, 1, 0]) + 1e6,
        Rotation.from_euler("xyz", [1, 2, 3]).apply(GOOD * [1, 1, 0]).astype(np.float32),
    ],
    ids=["axis", "tilted", "far away", "float32"],
)
def test_plane_is_recognised_with_a_warning(points, caplog):
    with caplog.at_level(logging.WARNING):
        found = cloud.prepare(points)
    assert found.flat
    assert "side that their normals point to is arbitrary" in caplog.text
    # Up to the input's rounding: 1e6 in double, and 3 in single precision, keep ten and seven digits.
    assert np.ptp(found.points, axis=0)[2] < 1e-6


def test_thin_but_solid_points_are_not_flat(caplog):
    with caplog.at_level(logging.WARNING):
        assert not cloud.prepare(GOOD * [1, 1, 1e-7]).flat
    assert caplog.text == ""


def test_morton_order_keeps_neighbours_together():
    points = np.random.default_rng(0).random((4096, 3))
    order, leads = cloud.morton_distinct(points)
    assert leads.all()
    np.testing.assert_array_equal(np.sort(order), np.arange(4096))
    # The mean step between points at random is 0.66, the spacing 1/16. Measured along the curve: 0.082.
    assert np.linalg.norm(np.diff(points[order], axis=0), axis=1).mean() < 0.1


@pytest.mark.parametrize("rows", [False, True], ids=["array", "list of rows"])
def test_masked_values_are_refused(rows):
    """NumPy drops a mask without a word; what lies under it, such as a reader's -9999, is no point."""
    points = np.random.default_rng(0).random((20, 3))
    points[:3] = -9999
    masked = np.ma.masked_values(points, -9999)
    with pytest.raises(ValueError, match="points must not hold masked values, found a mask"):
        cloud.prepare(list(masked) if rows else masked)
    assert cloud.prepare(masked[3:]).size == 17
