"""Steps that know where sensors stood: one cage for all of them, written to and read from chain files."""

import numpy as np
import pytest

from face_plugin import estimate_normals
from face_plugin.filters import Chain, Interior, Normals, PointSet, Sculpt, Thin
from face_plugin.sculpt import SculptFile
from face_plugin.shapes import box
from face_plugin.sides.sensors import Sensors

ROOM = box(1000)
VIEW = [[0.1, 0.0, 0.2]]


def inward(layer):
    turned = layer.normals * ROOM.normals
    return (turned[layer.keep].sum(axis=1) < 0).all()


def test_normals_are_those_of_the_array_call():
    layer = Normals(viewpoints=VIEW)(PointSet(ROOM.points))
    assert np.array_equal(layer.normals, estimate_normals(ROOM.points, viewpoints=VIEW).normals)
    assert inward(layer)


def test_steps_before_and_after_share_the_cage():
    steps = [Normals(viewpoints=np.array(VIEW)), Interior()]
    for chain in (Chain(steps), Chain(steps[::-1])):
        layer = chain(PointSet(ROOM.points))
        assert layer.keep.all()
        assert inward(layer)
    layer = Normals(viewpoints=VIEW)(PointSet(ROOM.points))
    # The same sensors again need no other solve, and other ones do.
    assert Normals(viewpoints=VIEW)(layer).cage is layer.cage
    assert Interior()(layer).keep.all()
    assert Normals(up=(0, 0, 1))(layer).cage is not layer.cage


def test_a_layers_own_sensors_reach_every_step(tmp_path):
    file = str(tmp_path / "edits.json")
    SculptFile(charges=((0.0, 0.0, 0.3),)).save(file)
    rows = np.zeros(1000, dtype=int)
    layer = PointSet(ROOM.points, sensors=Sensors(VIEW, rows))
    assert inward(Normals()(layer))
    assert inward(Chain([Thin(0.05), Normals()])(layer))
    assert inward(Chain([Sculpt(file), Normals()])(layer))
    assert np.array_equal(layer.replace(keep=np.arange(1000) < 9).kept().sensors.seen_from, rows[:9])


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_a_file_holds_them_as_plain_lists(suffix, tmp_path):
    chain = Chain([Normals(viewpoints=np.array(VIEW), up=(0, 0, 1)), Interior()])
    chain.save(tmp_path / f"chain{suffix}")
    text = (tmp_path / f"chain{suffix}").read_text(encoding="utf-8").replace("\n", "").replace(" ", "")
    assert "[[0.1,0.0,0.2]]" in text
    assert Chain.load(tmp_path / f"chain{suffix}") == chain
    assert chain.to_dict()["steps"][0] == {"filter": "normals", "viewpoints": VIEW, "up": [0.0, 0.0, 1.0]}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"viewpoints": [[1, 2]]}, r"step 1 \(normals\): viewpoints must have the shape \(k, 3\), found \(1, 2\)"),
        ({"up": [0, 0, 0]}, "up must be a direction, found a vector of length 0"),
        ({"viewpoint": [0, 0, 0]}, "unknown option 'viewpoint'; allowed are .*viewpoints"),
    ],
)
def test_bad_ones_are_named_with_their_step(options, message):
    with pytest.raises(ValueError, match=message):
        Chain.from_dict({"steps": [{"filter": "normals", **options}]})


def test_rows_must_fit_the_points():
    layer = PointSet(ROOM.points, keep=np.arange(1000) > 0, sensors=Sensors(VIEW, np.zeros(5, dtype=int)))
    with pytest.raises(ValueError, match="seen_from must have a row for each of the 1000 points, found 5"):
        Normals()(layer)
