"""Which clouds are tiled, and what tiles refuse."""

import numpy as np
import pytest

from face_plugin import Execution
from face_plugin.shapes import sphere
from face_plugin.tiles import estimate_tiled, in_tiles

EXECUTION = Execution(tile_points=1000, engine="serial")


def test_bad_input_is_judged_as_in_one_piece():
    with pytest.raises(ValueError, match=r"points must have the shape \(n, 3\)"):
        estimate_tiled(np.zeros((5, 2)), execution=EXECUTION)
    bad = sphere(3000).points
    bad[7] = np.nan
    with pytest.raises(ValueError, match=r"found NaN or infinity in 1 of 3000 rows: 7"):
        estimate_tiled(bad, execution=EXECUTION)
    line = np.arange(3000.0)[:, None] * np.array([[1.0, 2.0, 3.0]])
    with pytest.raises(ValueError, match="must not all lie on one line"):
        estimate_tiled(line, execution=EXECUTION)


def test_which_clouds_are_tiled():
    assert not in_tiles(1000, Execution(tile_points=1000))
    assert in_tiles(1001, Execution(tile_points=1000))
    assert in_tiles(10_000_000, Execution())
    assert in_tiles(40_000, Execution(max_memory=0.5))
    assert not in_tiles(40_000, Execution(max_memory=8.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tile_points": 10}, "tile_points must be an integer >= 1000, found 10"),
        ({"tile_points": 2e4}, "tile_points must be an integer"),
        ({"max_memory": -1.0}, "max_memory must be in"),
        ({"workers": 0}, "workers must be an integer >= 1, found 0"),
        ({"engine": "spark"}, "engine must be one of"),
    ],
)
def test_settings_out_of_range(changes, message):
    with pytest.raises(ValueError, match=message):
        Execution(**changes)


def test_less_memory_than_a_tile_needs():
    with pytest.raises(ValueError, match=r"max_memory must be at least 0\.\d+ GB, found 0\.10"):
        estimate_tiled(sphere(3000).points, execution=Execution(tile_points=1000, max_memory=0.1))
