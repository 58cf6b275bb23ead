"""How much memory there is, and what fits into it."""

import pytest

from face_plugin.memory import _container_memory, _machine_memory, available_memory, usable_cores
from face_plugin.tiles.plan import PROCESS_BYTES, fitting_tile_points, tile_memory


def test_the_machine_says_what_is_available(tmp_path):
    meminfo = tmp_path / "meminfo"
    meminfo.write_text("MemTotal:       24000000 kB\nMemFree:  100 kB\nMemAvailable:    2000000 kB\n")
    assert _machine_memory(meminfo) == 2_000_000 * 1024
    # Elsewhere than on Linux: all there is, or a guess.
    assert _machine_memory(tmp_path / "none") > 1e8


def test_a_container_may_have_less(tmp_path):
    assert _container_memory(tmp_path) == float("inf")
    (tmp_path / "memory.max").write_text("max\n")
    (tmp_path / "memory.current").write_text("1000000\n")
    assert _container_memory(tmp_path) == float("inf")
    (tmp_path / "memory.max").write_text("5000000\n")
    assert _container_memory(tmp_path) == 4_000_000


def test_this_machine():
    assert 1e7 < available_memory() < 1e14
    assert 1 <= usable_cores() <= 4096


def test_tiles_shrink_to_the_memory():
    assert fitting_tile_points(tile_memory(5_000), 20_000) == pytest.approx(5_000, abs=1)
    assert fitting_tile_points(1e12, 20_000) == 20_000
    with pytest.raises(ValueError, match=r"max_memory must be at least 0\.\d\d GB, found 0\.26"):
        fitting_tile_points(PROCESS_BYTES, 20_000)


def test_small_tiles_are_mostly_halo():
    def a_point(tile):
        return (tile_memory(tile) - PROCESS_BYTES) / tile

    # Measured with a ball at every point: 33 kB a point in the worst of 34 tiles of 3,000; 17 kB in one of 20,000.
    assert a_point(3_000) == pytest.approx(45e3, rel=0.1)
    assert a_point(20_000) > 17e3
