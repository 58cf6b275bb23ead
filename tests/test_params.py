import dataclasses
import json
import math

import numpy as np
import pytest

from face_plugin import Params
from face_plugin.params import ALPHAS, CHOICES

NUMBERS = {
    "ball_radius": ([0.1, 0.45, 0.49], [0.0, 0.5, -0.1, 2.0]),
    "cage_spacing": ([0, 0.0, 3.5, 1e9], [-1e-9, -1.0]),
    "padding": ([1e-3, 0.1, 99], [0.0, -0.1, 100.0]),
    "grading": ([0.1, 0.8, 2.0, 2], [0.0, -1.0, 2.1]),
    "finest": ([0.5, 1.5, 10.0], [0.0, -1.0, 10.5]),
    "alpha": ([0.01, 0.5], [0.0, 1.0, -0.1, 1.5]),
}
NOT_NUMBERS = [math.nan, math.inf, -math.inf, 10**400, True, np.True_, "0.1", [0.1], np.array([0.1, 0.2]), 1j]


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers(name):
    good, bad = NUMBERS[name]
    for value in good:
        assert getattr(Params(**{name: value}), name) == value
    for value in [*bad, *NOT_NUMBERS]:
        with pytest.raises(ValueError, match=rf"^{name} must be .*found"):
            Params(**{name: value})


@pytest.mark.parametrize("name", CHOICES)
def test_choices(name):
    for value in CHOICES[name]:
        assert getattr(Params(**{name: value}), name) == value
    for value in ("", "no such thing", None, 1, b"auto", [], np.array(CHOICES[name]), {}):
        with pytest.raises(ValueError, match=rf"^{name} must be one of"):
            Params(**{name: value})


@pytest.mark.parametrize("value", [-1, 1.0, "0", None, True])
def test_seed(value):
    with pytest.raises(ValueError, match=r"^seed must be an integer >= 0"):
        Params(seed=value)


@pytest.mark.parametrize("value", ["", "q", None, 5, b"auto", ["auto"], np.array(["auto", "serial"])])
def test_engine(value):
    with pytest.raises(ValueError, match=r"^engine must be one of .* or an address, found"):
        Params(engine=value)


def test_numpy_scalars_serve_as_numbers():
    params = Params(ball_radius=np.float32(0.25), padding=np.int8(2), seed=np.uint64(2**63), tile_points=np.int64(2000))
    assert (params.ball_radius, params.padding, params.seed, params.tile_points) == (0.25, 2, 2**63, 2000)
    # As Python's own numbers: those go through JSON.
    assert Params(**json.loads(json.dumps(params.to_dict()))) == params
    for name in ("seed", "tile_points", "workers"):
        with pytest.raises(ValueError, match=rf"^{name} must be an integer"):
            Params(**{name: np.float64(2000)})


def test_names_of_alpha():
    for name in ("auto", *ALPHAS):
        assert Params(alpha=name).alpha == name
    with pytest.raises(ValueError, match=r"^alpha must be a number or one of"):
        Params(alpha="thick")


def test_every_field_is_documented_with_its_unit_or_meaning():
    source = Params.__module__
    import importlib
    import inspect

    text = inspect.getsource(importlib.import_module(source))
    for field in dataclasses.fields(Params):
        assert text.count(f"\n    {field.name}: ") == 1
        after = text.split(f"\n    {field.name}: ")[1].split("\n", 1)[1].lstrip()
        assert after.startswith('"""'), field.name


def test_frozen_and_replaced():
    params = Params()
    with pytest.raises(dataclasses.FrozenInstanceError):
        params.seed = 3
    assert dataclasses.replace(params, seed=3) == Params(seed=3)
    with pytest.raises(ValueError, match=r"^grading"):
        dataclasses.replace(params, grading=-1.0)


def test_dictionary_is_complete_and_goes_through_json():
    params = Params(cage_spacing=0.5, alpha="sparse", seed=7)
    assert Params(**json.loads(json.dumps(params.to_dict()))) == params
    assert set(params.to_dict()) == {field.name for field in dataclasses.fields(Params)}


def test_choices_of_the_paper():
    paper = Params.paper(seed=5)
    assert (paper.solid, paper.mesher, paper.directions, paper.angles) == (
        "icosahedron",
        "tetgen",
        "icosahedron",
        "field",
    )
    assert (paper.ball_radius, paper.padding, paper.cage_spacing, paper.seed) == (0.45, 0.1, 0.0, 5)
