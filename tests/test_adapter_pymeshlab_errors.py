"""What the filters for PyMeshLab answer where its own would refuse."""

import builtins

import numpy as np
import pytest
from layers import NAMES, SHAPE, layer, ml

from face_plugin.adapters import pymeshlab as face


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"spacing": 1}, "PyMeshLabException", "Parameter spacing not found for filter compute_normal_by_"),
        ({"cage_spacing": 0.1}, "PyMeshLabException", "must be a pymeshlab.PercentageValue object or"),
        ({"alpha": "thick"}, "RuntimeError", "[uU]nable to cast Python instance of type <class 'str'>"),
        ({"alpha": None}, "RuntimeError", "unable to cast Python instance of type <class 'NoneType'>"),
        ({"viewpont": (0, 0, 0)}, "PyMeshLabException", r"Parameter viewpont not found .* Did you mean viewpos\?"),
        ({"viewpos": [1, 2]}, "PyMeshLabException", "Parameter viewpos: must be 3 finite numbers, found"),
        ({"viewpos": "here"}, "ValueError", "could not convert string to float"),
        ({"seed": 1.5}, "RuntimeError", "unable to cast Python instance of type <class 'float'>"),
        ({"onselected": "yes"}, "RuntimeError", "unable to cast Python instance of type <class 'str'>"),
        ({"solid": "cube"}, "InvalidEnumException", "Enum 'cube' not found. Possible values are 'octa"),
        ({"solid": 2}, "InvalidEnumException", "Enum 2 not valid. Must be a value between 0 and 2"),
        ({"engine": 1}, "RuntimeError", "unable to cast Python instance of type <class 'int'>"),
        (
            {"engine": "cloud"},
            "PyMeshLabException",
            "Failed to apply filter: (.|\n)*engine must",
        ),
        ({"solid": 0.5}, "RuntimeError", "unable to cast Python instance of type <class 'float'>"),
        ({"alpha": 1.5}, "PyMeshLabException", "Failed to apply filter: compute_.*\nDetails: alpha must"),
        ({"seed": -1}, "PyMeshLabException", "Failed to apply filter: compute_.*\nDetails: seed must"),
    ],
)
def test_wrong_parameters_raise_what_pymeshlab_raises(arguments, error, message):
    kind = getattr(ml, error, None) or getattr(builtins, error)
    ms = layer()
    with pytest.raises(kind, match=message) as caught:
        face.compute_normal_by_faraday_cage(ms, **arguments)
    assert type(caught.value) is kind
    assert not ms.mesh(0).vertex_normal_matrix().any()


def test_the_kinds_of_errors_are_those_of_pymeshlabs_own_filters():
    ms = layer()
    for error, arguments in (
        (ml.PyMeshLabException, {"spacing": 1}),
        (RuntimeError, {"k": "ten"}),
        (RuntimeError, {"k": 1.5}),
        (RuntimeError, {"flipflag": "yes"}),
        (ml.PyMeshLabException, {"viewpos": [1, 2]}),
        (ValueError, {"viewpos": "here"}),
    ):
        with pytest.raises(error) as caught:
            ms.compute_normal_for_point_clouds(**arguments)
        assert type(caught.value) is error
    with pytest.raises(ml.InvalidEnumException, match="Enum 'cube' not found"):
        ms.compute_color_from_scalar_per_vertex(colormap="cube")
    with pytest.raises(ml.PyMeshLabException, match=r"must be a pymeshlab\.Percentage"):
        ms.generate_sampling_poisson_disk(radius=0.1)


@pytest.mark.parametrize("name", NAMES)
def test_without_a_layer_the_filters_say_what_meshlabs_say(name):
    with pytest.raises(ml.PyMeshLabException, match=f"{name} requires at least one mesh"):
        getattr(face, name)(ml.MeshSet())


def test_only_the_selection_of_a_layer_without_one():
    ms = layer()
    ms.set_selection_none()
    with pytest.raises(ml.PyMeshLabException, match="there is no selection") as ours:
        face.compute_normal_by_faraday_cage(ms, onselected=True)
    with pytest.raises(ml.PyMeshLabException) as host:
        ms.compute_normal_by_function_per_vertex(onselected=True)
    assert str(ours.value).split("\n")[1] == str(host.value).split("\n")[1]


def test_bad_points_are_the_filters_failure():
    ms = ml.MeshSet()
    ms.add_mesh(ml.Mesh(np.eye(3)))
    with pytest.raises(ml.PyMeshLabException, match="Details: points must hold at least 4 points, found 3"):
        face.compute_normal_by_faraday_cage(ms)


def test_an_attribute_that_breaks_meshlabs_expressions_is_named_as_the_cause():
    ms = ml.MeshSet()
    ms.add_mesh(ml.Mesh(SHAPE.points))
    ms.current_mesh().add_vertex_custom_scalar_attribute(np.zeros(600), "scan angle")
    with pytest.raises(ml.PyMeshLabException, match="may have a name that is no identifier"):
        face.compute_normal_by_faraday_cage(ms)


def test_a_misspelt_filter_is_answered_with_the_nearest_name():
    face.register()
    try:
        with pytest.raises(ml.PyMeshLabException, match=r"Did you mean compute_normal_by_faraday_cage\?"):
            layer().apply_filter("compute_normals_by_faraday_cage")
        with pytest.raises(ml.PyMeshLabException, match="There are compute_normal_by_faraday_cage, compute_sel"):
            layer().apply_filter("faraday")
        with pytest.raises(ml.PyMeshLabException, match="Filter does not exists"):
            layer().apply_filter("compute_normals")
    finally:
        face.unregister()


@pytest.mark.parametrize("name", NAMES)
def test_a_mesh_or_an_array_is_a_type_error_that_says_what_to_pass(name):
    for found in (ml.Mesh(SHAPE.points), SHAPE.points):
        with pytest.raises(TypeError, match=r"ms must be a MeshSet, found \w+: pass a pymeshlab.MeshSet"):
            getattr(face, name)(found)
