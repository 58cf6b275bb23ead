"""Who solves the tiles: what engines do with a mesher that changes the process."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from face_plugin import Execution, FaceError
from face_plugin.faraday.meshers.delaunay import tetrahedralize
from face_plugin.shapes import sphere
from face_plugin.tiles import estimate_tiled
from face_plugin.tiles.engines import Processes, Serial
from face_plugin.tiles.plan import make_engine
from face_plugin.tiles.tile import warm_up


def test_gmsh_leaves_broken_pipes_to_python():
    """It sets SIGPIPE to kill the process, which a lost worker would then do to the one that waits for it."""
    tetrahedralize(sphere(200).points, "gmsh")
    read, write = os.pipe()
    os.close(read)
    with pytest.raises(BrokenPipeError):
        os.write(write, b"x")
    os.close(write)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGPIPE, signal.SIGHUP])
def test_gmsh_leaves_signals_to_the_handlers_of_the_program(number):
    """It sets SIGTERM to end the process: nothing is closed then, and temporary files stay."""
    script = (
        "import os, signal, sys\n"
        "from face_plugin.faraday.meshers.delaunay import tetrahedralize\n"
        "from face_plugin.shapes import sphere\n"
        "number = int(sys.argv[1])\n"
        "signal.signal(number, lambda *_: print('heard', flush=True))\n"
        "tetrahedralize(sphere(100).points, 'gmsh')\n"
        "os.kill(os.getpid(), number)\n"
        "print('alive', flush=True)\n"
    )
    done = subprocess.run([sys.executable, "-c", script, str(int(number))], capture_output=True, text=True)
    assert done.stdout.split() == ["heard", "alive"], done


def _alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_processes_end_with_the_one_that_started_them():
    script = (
        "import time\n"
        "from face_plugin.tiles.engines import Processes, Serial\n"
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
    deadline = time.monotonic() + 60
    while any(map(_alive, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(_alive, workers))


def _die(folder, tile):
    os.kill(os.getpid(), signal.SIGKILL)


def _fail(folder, tile):
    raise ValueError(f"tile {tile}")


@pytest.mark.slow
def test_processes_that_die_again_and_again_end_the_run():
    with Processes(2) as engine, pytest.raises(FaceError, match=r"died 3 times .*tile_points"):
        engine.run(_die, "", [0, 1, 2], print)
    with Processes(1) as engine, pytest.raises(ValueError, match=r"tile \d"):
        engine.run(_fail, "", [0, 1, 2], print)


def _whose(folder, tile):
    with open(f"{folder}/{tile}", "w") as stream:
        stream.write(str(os.getpid()))
    return tile


def test_this_process_takes_part(tmp_path):
    done = []
    with Processes(2, takes_part=True) as engine:
        assert engine._pool._max_workers == 1
        engine.run(_whose, str(tmp_path), [3, 4, 5, 6, 7], done.append)
    assert sorted(done) == [3, 4, 5, 6, 7]
    pids = [int((tmp_path / str(tile)).read_text()) for tile in done]
    assert os.getpid() in pids
    assert len(set(pids)) == 2


def test_it_takes_part_where_there_is_a_tile_for_each():
    execution = Execution(engine="processes", workers=2, max_memory=8.0)
    assert make_engine(execution, 1000, 2000).takes_part
    assert not make_engine(execution, 1000, 2001).takes_part
    assert not Processes(1, takes_part=True).takes_part


def test_two_tiles_are_the_same_here_and_there():
    ball = sphere(2000).points
    kinds = [Execution(tile_points=1000, engine=engine, workers=2) for engine in ("serial", "processes")]
    one, two = (estimate_tiled(ball, execution=execution) for execution in kinds)
    assert np.array_equal(one.normals, two.normals)
    assert np.array_equal(one.confidence, two.confidence)


def test_a_process_is_copied_only_where_it_has_no_threads_of_others():
    # In a process of its own: this one may have any threads.
    script = (
        "import sys, threading, warnings\n"
        "warnings.simplefilter('error')\n"
        "import numpy as np\n"
        "from face_plugin import Execution\n"
        "from face_plugin.shapes import sphere\n"
        "from face_plugin.tiles import engines, estimate_tiled\n"
        "ball = sphere(2000).points\n"
        "one = estimate_tiled(ball, execution=Execution(tile_points=1000, engine='serial'))\n"
        "for forks in (sys.platform == 'linux', False):\n"
        "    assert engines._may_fork() == forks\n"
        "    two = estimate_tiled(ball, execution=Execution(tile_points=1000, engine='processes', workers=2))\n"
        "    assert np.array_equal(one.normals, two.normals)\n"
        "    assert np.array_equal(one.confidence, two.confidence)\n"
        "    threading.Thread(target=threading.Event().wait, daemon=True).start()\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)


def test_engines_by_name():
    assert isinstance(make_engine(Execution(engine="serial"), 1000, 5000), Serial)
    assert isinstance(make_engine(Execution(engine="processes", workers=3), 1000, 5000), Processes)
    assert make_engine(Execution(engine="processes", workers=8, max_memory=16.0), 1000, 3000).workers == 3
    # 0.6 GB hold this process and one more.
    assert make_engine(Execution(engine="processes", workers=8, max_memory=0.6), 1000, 9000).workers == 1
    assert isinstance(make_engine(Execution(workers=1), 1000, 9000), Serial)
    own = Serial()
    assert make_engine(Execution(engine=own), 1000, 5000) is own
    with pytest.raises(ValueError, match="engine must be"):
        Execution(engine="threads")
    with pytest.raises(ValueError, match="engine must be"):
        Execution(engine=3)


def test_warming_up_takes_a_cloud_through_both_stages():
    # What a process submits at its start fails silently there.
    warm_up()
