"""The functions for PDAL's filters.python, with dictionaries of arrays as it passes and reads them."""

import inspect

import numpy as np
import pytest

from face_plugin import Params, estimate_normals
from face_plugin.adapters import pdal
from face_plugin.shapes import box, nested_box, torus

SHAPE = torus(600)
VIEW = [[0.1, 0.0, -0.2]]


def dimensions(points, *, normals=True, dtype=np.float64):
    """Make what PDAL passes: one contiguous array a dimension, of the dimension's own type."""
    ins = {name: np.ascontiguousarray(points[:, axis]) for axis, name in enumerate("XYZ")}
    ins["Intensity"] = np.arange(len(points), dtype=np.uint16)
    if normals:
        ins |= {name: np.zeros(len(points), dtype=dtype) for name in pdal.NORMAL}
    return ins


def memory(array, itemsize):
    """Read an output as PDAL does: the bytes at its address, element after element."""
    assert array.flags.c_contiguous
    assert array.itemsize == itemsize
    return np.frombuffer(array.tobytes(), dtype=array.dtype)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_normals_go_to_their_dimensions_in_their_type(dtype):
    ins, outs = dimensions(SHAPE.points, dtype=dtype), {}
    assert pdal.estimate_normals(ins, outs) is True
    expected = estimate_normals(SHAPE.points).normals.astype(dtype)
    assert sorted(outs) == sorted(pdal.NORMAL)
    for axis, name in enumerate(pdal.NORMAL):
        assert np.array_equal(memory(outs[name], np.dtype(dtype).itemsize), expected[:, axis])
    assert not ins["NormalX"].any()


def test_interior_points_are_masked():
    shape = nested_box(900)
    outs = {}
    assert pdal.remove_interior(dimensions(shape.points, normals=False), outs) is True
    expected = ~estimate_normals(shape.points, filter_interior=True).interior
    assert list(outs) == ["Mask"]
    assert np.array_equal(memory(outs["Mask"], 1), expected)


def test_a_function_with_settings():
    shape = nested_box(900)
    step = pdal.configured(interior=True, seed=2, alpha=0.02)
    outs = {}
    assert step(dimensions(shape.points), outs) is True
    result = estimate_normals(shape.points, Params(seed=2, alpha=0.02), filter_interior=True)
    assert np.array_equal(outs["NormalZ"], result.normals[:, 2])
    assert np.array_equal(outs["Mask"], ~result.interior)
    with pytest.raises(ValueError, match="alpha must be in"):
        pdal.configured(alpha=2.0)


@pytest.mark.parametrize(
    "viewpoint",
    ["POINT Z (0.1 0 -0.2)", " point(0.1 0 -0.2)", '{"type": "Point", "coordinates": [0.1, 0, -0.2]}', VIEW],
)
def test_a_viewpoint_as_pdal_writes_it(viewpoint):
    room, outs = box(600), {}
    step = pdal.configured(interior=True, viewpoint=viewpoint)
    assert step(dimensions(room.points), outs) is True
    expected = estimate_normals(room.points, viewpoints=VIEW).normals
    assert np.array_equal(np.stack([outs[name] for name in pdal.NORMAL], axis=1), expected)
    assert ((expected * room.normals).sum(axis=1) < 0).all()
    # The room's walls are no interior of anything.
    assert "Mask" not in outs


def test_always_up():
    side = np.stack(np.meshgrid(np.linspace(-1, 1, 25), np.linspace(-1, 1, 25)), axis=-1).reshape(-1, 2)
    outs = {}
    pdal.configured(always_up=True)(dimensions(np.column_stack([side, 0.2 * np.sin(3 * side[:, 0])])), outs)
    assert (outs["NormalZ"] > 0).all()


@pytest.mark.parametrize(
    "viewpoint", ["POINT (1 2)", "here", "[1, 2, 3]", "POINT Z (a b c)", "LINESTRING (0 0 0, 1 1 1)"]
)
def test_a_viewpoint_that_is_none(viewpoint):
    with pytest.raises(
        ValueError, match=r"viewpoint must be a point with x, y and z, such as 'POINT Z \(1 2 3\)', found"
    ):
        pdal.configured(viewpoint=viewpoint)


@pytest.mark.parametrize("function", [pdal.estimate_normals, pdal.remove_interior, pdal.configured()])
def test_pdal_calls_with_two_arguments_and_accepts_no_function_with_more(function):
    assert len(inspect.getfullargspec(function).args) == 2


def test_a_missing_dimension_is_named_with_what_to_add():
    with pytest.raises(ValueError, match="no dimension NormalX: add_dimension must list NormalX, "):
        pdal.estimate_normals(dimensions(SHAPE.points, normals=False), {})
    with pytest.raises(ValueError, match="ins must hold the dimensions X, Y and Z, found X, Y"):
        pdal.estimate_normals({"X": SHAPE.points[:, 0], "Y": SHAPE.points[:, 1]}, {})
