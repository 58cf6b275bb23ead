"""Searches on all cores."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin.threads import KDTree

POINTS = np.random.default_rng(0).random((3000, 3))


@pytest.mark.parametrize("k", [1, 2, 97, [1], [2, 5]])
def test_the_nearest_are_those_of_scipy(k):
    for queries in (POINTS, POINTS[:3] + 1, POINTS[:0]):
        for found, expected in zip(
            KDTree(POINTS).query(queries, k=k), cKDTree(POINTS).query(queries, k=k), strict=True
        ):
            assert found.dtype == expected.dtype
            np.testing.assert_array_equal(found, expected)


def test_those_within_a_distance_are_those_of_scipy():
    reach = np.linspace(0, 0.2, len(POINTS))
    found = KDTree(POINTS).within(POINTS, reach)
    expected = cKDTree(POINTS).query_ball_point(POINTS, reach)
    assert [sorted(x) for x in found] == [sorted(x) for x in expected]


def test_an_interrupted_search_leaves_nothing_running():
    """SciPy's own threads would write into what is free by then, and end the process by a signal."""
    program = """
import os, signal, threading, time
import numpy as np
from face_plugin.threads import KDTree
signal.signal(signal.SIGINT, signal.default_int_handler)
points = np.random.default_rng(0).random((100_000, 3))
tree, caught = KDTree(points), 0
for k in range(8):
    timer = threading.Timer(0.02 * (1 + k), os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        tree.query(points, k=97)
        time.sleep(10)
    except KeyboardInterrupt:
        caught += 1
    timer.join()
    assert threading.active_count() == 1
    np.full((100_000, 97), -1.0)
print(caught)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "8\n"


def test_what_lies_beyond_the_bound_is_not_found():
    distance, _ = KDTree(np.arange(4.0)[:, None] * np.ones((1, 3))).query(np.zeros((1, 3)), k=4, bound=2.0)
    np.testing.assert_allclose(distance, [[0.0, np.sqrt(3.0), np.inf, np.inf]])
