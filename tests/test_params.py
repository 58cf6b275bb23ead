import dataclasses
import inspect
import json
import math
import warnings

import numpy as np
import pytest

from face_plugin import Execution, Params, estimate_normals
from face_plugin.params import ALPHAS, CHOICES, settled
from face_plugin.shapes import sphere
from face_plugin.tiles.engines import Serial

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


@pytest.mark.parametrize("value", ["", "q", None, 5, object(), b"auto", ["auto"], np.array(["auto", "serial"])])
def test_engine(value):
    with pytest.raises(ValueError, match=r"^engine must be one of .* an address such as .*, found"):
        Execution(engine=value)


def test_numpy_scalars_serve_as_numbers():
    params = Params(ball_radius=np.float32(0.25), padding=np.int8(2), seed=np.uint64(2**63))
    execution = Execution(tile_points=np.int64(2000), max_memory=np.float32(0.5))
    assert (params.ball_radius, params.padding, params.seed) == (0.25, 2, 2**63)
    assert (execution.tile_points, execution.max_memory) == (2000, 0.5)
    # As Python's own numbers: those go through JSON.
    assert Params(**json.loads(json.dumps(params.to_dict()))) == params
    assert Execution(**json.loads(json.dumps(execution.to_dict()))) == execution
    for settings, name in ((Params, "seed"), (Execution, "tile_points"), (Execution, "workers")):
        with pytest.raises(ValueError, match=rf"^{name} must be an integer"):
            settings(**{name: np.float64(2000)})


def test_names_of_alpha():
    for name in ("auto", *ALPHAS):
        assert Params(alpha=name).alpha == name
    with pytest.raises(ValueError, match=r"^alpha must be a number or one of"):
        Params(alpha="thick")


@pytest.mark.parametrize("settings", [Params, Execution])
def test_every_field_is_documented_with_its_unit_or_meaning(settings):
    text = inspect.getsource(settings)
    for field in dataclasses.fields(settings):
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


def test_what_params_said_of_the_execution_still_takes_effect_with_a_warning():
    with pytest.warns(DeprecationWarning, match=r"pass execution=face_plugin.Execution\(tile_points=2000, workers=1\)"):
        params = Params(seed=3, tile_points=np.int64(2000), workers=1)
    assert params == Params(seed=3)
    assert set(params.to_dict()) == {field.name for field in dataclasses.fields(Params)}
    with pytest.warns(DeprecationWarning, match="^tile_points, workers: no longer"):
        assert dataclasses.replace(params, alpha=0.1).tile_points == 2000
    assert settled(params) == (Params(seed=3), Execution(tile_points=2000, workers=1))
    with pytest.raises(ValueError, match=r"tile_points, workers must be given in execution alone"):
        settled(params, Execution())
    with pytest.raises(ValueError, match=r"tile_points must be an integer >= 1000, found 5"):
        Params(tile_points=5)


def test_the_engine_as_an_argument_still_takes_effect_with_a_warning():
    class Counting(Serial):
        runs = 0

        def run(self, job, folder, tiles, done):
            self.runs += 1
            super().run(job, folder, tiles, done)

    ball, field, engine = sphere(2000), Params(angles="field"), Counting()
    with pytest.warns(DeprecationWarning, match="^tile_points, engine: no longer"):
        params = dataclasses.replace(field, tile_points=1000, engine="processes")
    with pytest.warns(DeprecationWarning, match=r"^engine: no longer") as said:
        old = estimate_normals(ball.points, params, engine=engine)
    assert said[0].filename == __file__
    assert engine.runs == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tiles = Execution(tile_points=1000, engine=engine)
        new = estimate_normals(ball.points, field, execution=tiles)
    assert np.array_equal(old.normals, new.normals)
    assert old.params == new.params == field
    with pytest.raises(ValueError, match="engine must be a name or an address to be written down"):
        tiles.to_dict()


@pytest.mark.parametrize("name", ["params", "execution"])
def test_settings_of_the_wrong_type(name):
    with pytest.raises(TypeError, match=rf"{name} must be a face_plugin\.{name.title()} or None, found dict: pass"):
        settled(**{"params": None, name: {}})
