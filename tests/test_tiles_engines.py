"""Who solves the tiles: what engines do with a mesher that changes the process."""

import os
import signal
import subprocess
import sys
import time

import pytest

from face_plugin.meshers.delaunay import tetrahedralize
from face_plugin.shapes import sphere


def test_gmsh_leaves_broken_pipes_to_python():
    """It sets SIGPIPE to kill the process, which a lost worker would then do to the one that waits for it."""
    tetrahedralize(sphere(200).points, "gmsh")
    read, write = os.pipe()
    os.close(read)
    with pytest.raises(BrokenPipeError):
        os.write(write, b"x")
    os.close(write)


def _alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_processes_end_with_the_one_that_started_them():
    script = (
        "import time\n"
        "from face_plugin.tiles.engines import Processes\n"
        "with Processes(2) as engine:\n"
        "    list(engine._pool.map(abs, range(4)))\n"
        "    print(*engine._pool._processes, flush=True)\n"
        "    time.sleep(60)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    workers = [int(pid) for pid in parent.stdout.readline().split()]
    assert len(workers) == 2
    assert all(map(_alive, workers))
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    deadline = time.monotonic() + 20
    while any(map(_alive, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(_alive, workers))
