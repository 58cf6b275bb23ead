"""Chains in files, and what they say of mistakes."""

import json

import numpy as np
import pytest

from face_plugin import Execution, Params
from face_plugin.errors import MeshingError
from face_plugin.filters import Chain, Interior, Normals, PointSet, Reconstruct, Sculpt, Thin
from face_plugin.filters.base import Filter

CHAIN = Chain(
    [
        Thin(0.125, seed=3),
        Sculpt("/edits/a b.json", Params(cage_spacing=0.0)),
        Normals(Params(cage_spacing=0.01, solid="icosahedron", alpha="dense"), execution=Execution(workers=3)),
        Interior("sparse"),
        Reconstruct(depth=9, screened=False, backend="pymeshlab"),
    ]
)


@pytest.mark.parametrize("suffix", [".json", ".toml", ".TOML"])
def test_a_chain_survives_its_file(tmp_path, suffix):
    path = tmp_path / f"chain{suffix}"
    CHAIN.save(path)
    assert Chain.load(path) == CHAIN


def test_a_chain_written_by_hand(tmp_path):
    path = tmp_path / "chain.toml"
    path.write_text(
        '# thin\n[[steps]]\nfilter = "thin"\ndistance = 1\n\n[[steps]]\nfilter = "normals"\nseed = 4\n',
        encoding="utf-8",
    )
    assert Chain.load(path) == Chain([Thin(1), Normals(Params(seed=4))])


def test_settings_of_method_and_execution_stand_beside_those_of_the_step():
    options = {"alpha": 0.2, "grading": 1.5, "tile_points": 2000, "engine": "serial"}
    step = Interior.from_dict(options)
    assert step == Interior(0.2, Params(grading=1.5), Execution(tile_points=2000, engine="serial"))
    assert step.to_dict() == {"filter": "interior", **options}
    assert Normals.from_dict({}) == Normals(None, execution=None)


def test_a_sculpt_lies_beside_its_chain(tmp_path):
    path = tmp_path / "chain.json"
    path.write_text(json.dumps({"steps": [{"filter": "sculpt", "file": "edits.json"}]}), encoding="utf-8")
    assert Chain.load(path).steps[0].file == str(tmp_path / "edits.json")


def test_a_chain_in_a_chain_is_its_steps():
    assert Chain([Chain([Thin(1.0)]), Normals()]) == Chain([Thin(1.0), Normals()])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"step": []}, "must hold a list named 'steps' and nothing else, found step"),
        ({}, "must hold a list named 'steps' and nothing else, found nothing"),
        ({"steps": [], "name": "a"}, "nothing else, found name, steps"),
        ({"steps": ["normals"]}, "step 1: must be a table with the key 'filter', found 'normals'"),
        ({"steps": [{"filter": "smooth"}]}, "step 1: unknown filter 'smooth'; allowed are normals, "),
        ({"steps": [{"filter": "normals"}, {"filter": "thin"}]}, r"step 2 \(thin\): the option 'distance'"),
        ({"steps": [{"filter": "thin", "distance": 1, "k": 3}]}, "unknown option 'k'; allowed are distance"),
        ({"steps": [{"filter": "normals", "padding": -1}]}, r"step 1 \(normals\): padding must be in"),
        ({"steps": [{"filter": "interior", "alpha": "thick"}]}, r"step 1 \(interior\): alpha must be"),
        ([1], "must hold a table, found list"),
    ],
)
def test_mistakes_name_the_file_and_the_step(tmp_path, content, message):
    path = tmp_path / "chain.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(ValueError, match=message) as caught:
        Chain.load(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(("name", "text"), [("a.json", "{"), ("a.toml", "= 3"), ("a.toml", "steps = 3")])
def test_malformed_files(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=name):
        Chain.load(path)


def test_other_extensions_are_refused(tmp_path):
    for call in (Chain.load, CHAIN.save):
        with pytest.raises(ValueError, match=r"a chain must be a \.json or \.toml file"):
            call(tmp_path / "chain.yaml")


def test_errors_while_running_name_the_step_and_keep_their_kind():
    with pytest.raises(ValueError, match=r"step 2 \(surface\): a surface needs normals"):
        Chain([Thin(0.1), Reconstruct()])(PointSet(np.eye(3)))

    class Failing(Filter):
        name = "failing"

        def __call__(self, layer, *, progress=None):
            raise MeshingError("no mesh")

    with pytest.raises(MeshingError, match=r"step 1 \(failing\): no mesh"):
        Chain([Failing()])(PointSet(np.eye(3)))
