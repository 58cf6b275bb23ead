"""What told the side of each part: the field, sensors, or nothing."""

import json

import numpy as np
import pytest

from face_plugin import Execution, Side, estimate_normals, examples, shapes
from face_plugin.app.cli import main
from face_plugin.filters import Chain, Normals, PointSet
from face_plugin.io import CloudFile, read_cloud, write_cloud

BALL = shapes.sphere(1800, seed=1)
FLOOR = np.column_stack([np.random.default_rng(0).uniform(-3, 3, (2500, 2)), np.full(2500, -1.5)])
BOTH = np.concatenate([BALL.points, FLOOR])
EITHER = [None, Execution(tile_points=1500, engine="serial")]
either = pytest.mark.parametrize("execution", EITHER, ids=["one piece", "tiles"])


def share(sides, side):
    return float((sides == side).mean())


@either
def test_a_body_over_a_floor(execution):
    sides = estimate_normals(BOTH, execution=execution).sides
    assert sides.dtype == np.uint8
    assert (sides[: len(BALL)] == Side.FIELD).all()
    assert (sides[len(BALL) :] == Side.CHOSEN).all()


@either
def test_only_what_was_seen_is_known_from_sensors(execution):
    """From above the floor is seen, but not the ball that lies under it; with nothing under it, all is seen."""
    under = np.concatenate([BALL.points - [0, 0, 4.0], FLOOR])
    sides = estimate_normals(under, up=(0, 0, 1), execution=execution).sides
    assert (sides[: len(BALL)] == Side.FIELD).all()
    assert (sides[len(BALL) :] == Side.SENSORS).all()
    assert (estimate_normals(BOTH, up=(0, 0, 1), execution=execution).sides == Side.SENSORS).all()


@pytest.mark.parametrize("name", examples.NAMES)
def test_examples_with_and_without_their_hints(name):
    scan = examples.load(name, 2000)
    # A room looks like the outside of a box.
    blind = Side.FIELD if name in ("object", "sketch", "room") else Side.CHOSEN
    assert share(estimate_normals(scan.points).sides, blind) > 0.99
    told = {"viewpoints": scan.viewpoints} if scan.viewpoints is not None else {"up": scan.up}
    if scan.viewpoints is not None or scan.up is not None:
        assert share(estimate_normals(scan.points, **told).sides, Side.SENSORS) > 0.95


def test_a_plane_has_no_side_of_its_own():
    flat = np.column_stack([np.random.default_rng(1).random((400, 2)), np.zeros(400)])
    assert (estimate_normals(flat).sides == Side.CHOSEN).all()
    assert (estimate_normals(flat, up=(0, 0, 1)).sides == Side.SENSORS).all()


def test_the_order_and_duplicates_of_the_input_are_kept():
    order = np.random.default_rng(2).permutation(len(BOTH))
    mixed = np.concatenate([BOTH[order], BOTH[order[:50]]])
    expected = np.where(np.concatenate([order, order[:50]]) < len(BALL), Side.FIELD, Side.CHOSEN)
    assert np.array_equal(estimate_normals(mixed).sides, expected)


def test_chains_have_it_as_an_attribute():
    layer = Chain([Normals()])(PointSet(BOTH))
    assert np.array_equal(layer.attributes["sides"], estimate_normals(BOTH).sides)
    assert np.array_equal(layer.attributes["open"], estimate_normals(BOTH).open)


@pytest.mark.parametrize("options", [[], ["--resume", "--tile-points", "1500", "--engine", "serial"]])
def test_the_command_counts_and_writes_it(options, tmp_path, capsys):
    source, out = tmp_path / "in.ply", tmp_path / "out.ply"
    write_cloud(source, CloudFile(BOTH))
    words = ["normals", str(source), "-o", str(out), "--scalars", *options]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["sides"] == {"chosen": 2500, "field": 1800, "sensors": 0}
    assert np.array_equal(read_cloud(out).attributes["sides"], np.repeat([1, 0], [1800, 2500]))
    assert main(words) == 0
    assert "the side of 2,500 is a guess" in capsys.readouterr().out
    assert main([*words, "--up", "z"]) == 0
    assert "guess" not in capsys.readouterr().out
