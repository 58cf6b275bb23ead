"""`PointSet`: what it checks, that it cannot be changed, and what it carries along."""

import numpy as np
import pytest

from face_plugin.filters import PointSet
from face_plugin.params import Params
from face_plugin.shapes import sphere


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": np.zeros((3, 4))}, r"points must have the shape \(n, 3\) or \(n, 2\), found \(3, 4\)"),
        ({"points": [[0, 0, np.nan]]}, "points must be finite, found NaN or infinity in 1 of 1 rows: 0"),
        ({"points": np.eye(3), "normals": np.eye(3)[:2]}, r"normals must be \(3, 3\) of.*found \(2, 3\)"),
        ({"points": np.eye(3), "normals": np.eye(3, dtype=int)}, "normals must be .* found .* of int64"),
        ({"points": np.eye(3), "keep": [True]}, r"keep must hold 3 booleans, found \(1,\) of bool"),
        ({"points": np.eye(3), "keep": [0, 1, 2]}, "keep must hold 3 booleans, found .* of int64"),
        ({"points": np.eye(3), "attributes": {"a": [1]}}, r"'a' must hold 3 rows, found shape \(1,\)"),
        ({"points": np.eye(3), "attributes": {"a": 1}}, r"attribute 'a' must hold 3 rows, found shape \(\)"),
    ],
)
def test_what_it_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        PointSet(**arguments)


def test_nothing_of_it_can_be_changed_but_the_callers_arrays_stay_writable():
    points, normals = np.eye(3), np.eye(3)
    layer = PointSet(points, normals, attributes={"label": np.arange(3)})
    for array in (layer.points, layer.normals, layer.keep):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(TypeError):
        layer.attributes["other"] = np.arange(3)
    with pytest.raises(AttributeError):
        layer.keep = np.zeros(3, dtype=bool)
    points[0, 0] = 5.0
    assert points.flags.writeable


def test_float32_stays_float32_and_integers_become_float64():
    assert PointSet(np.eye(3, dtype=np.float32)).points.dtype == np.float32
    assert PointSet(np.eye(3, dtype=np.int64)).points.dtype == np.float64


def test_the_kept_points_come_with_all_that_belongs_to_them():
    layer = PointSet(np.eye(3), -np.eye(3), [False, True, True], {"colour": np.arange(9).reshape(3, 3)})
    kept = layer.kept()
    assert np.array_equal(kept.points, np.eye(3)[1:])
    assert np.array_equal(kept.normals, -np.eye(3)[1:])
    assert np.array_equal(kept.attributes["colour"], [[3, 4, 5], [6, 7, 8]])
    assert kept.keep.all()


def test_a_solved_cage_is_shared_until_other_points_or_other_settings_are_asked_for():
    layer = PointSet(sphere(200).points)
    cage = layer.solved()
    layer = layer.replace(cage=cage)
    assert layer.solved() is cage
    assert layer.solved(Params()) is cage
    assert layer.solved(Params(padding=0.2)) is not cage
    assert layer.replace(attributes={"a": np.zeros(200)}).cage is cage
    assert layer.replace(keep=np.arange(200) < 150).cage is None
    assert layer.replace(keep=np.arange(200) < 150).solved().cloud.size == 150


def test_values_of_kept_points_go_back_to_their_rows():
    layer = PointSet(np.eye(3), keep=[True, False, True])
    assert layer.scatter(np.array([4.0, 5.0])).tolist() == [4.0, 0.0, 5.0]
    assert layer.scatter(np.ones((2, 3), dtype=np.float32)).dtype == np.float32
