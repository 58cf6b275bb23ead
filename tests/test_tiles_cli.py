"""`face normals` on large files."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np

from face_plugin import Execution, estimate_normals
from face_plugin.io import CloudFile, read_cloud, write_cloud
from face_plugin.shapes import sphere
from face_plugin.tiles.files import work_folder

FACE = [sys.executable, "-m", "face_plugin.app.cli"]
TILES = ["--tile-points", "1000", "--workers", "2"]


def test_tiles_by_options(tmp_path):
    ball = sphere(2500)
    write_cloud(tmp_path / "in.ply", CloudFile(ball.points))
    command = [*FACE, "normals", "in.ply", "-o", "out.ply", *TILES, "--engine", "processes", "--json"]
    out = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    said = json.loads(out)
    assert said["timings"]["tiles"] > 0
    asked = {"tile_points": 1000, "max_memory": None, "engine": "processes", "workers": 2}
    assert said["execution"] == asked
    assert not said["params"].keys() & asked.keys()
    expected = estimate_normals(ball.points, execution=Execution(tile_points=1000, engine="serial"))
    assert np.array_equal(read_cloud(tmp_path / "out.ply").normals, expected.normals)


def test_a_killed_run_is_resumed(tmp_path):
    ball = sphere(6000)
    np.save(tmp_path / "in.npy", ball.points)
    command = [*FACE, "normals", "in.npy", "-o", "out.npy", *TILES, "--engine", "serial", "--resume"]
    run = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL)
    folder = work_folder(tmp_path / "out.npy")
    while not list(folder.glob("field-*.npz")) and run.poll() is None:
        time.sleep(0.02)
    os.kill(run.pid, signal.SIGKILL)
    assert run.wait() == -signal.SIGKILL
    done = {path.name: path.stat().st_mtime_ns for path in folder.glob("field-*.npz")}
    assert 0 < len(done) < 6
    assert not (tmp_path / "out.npy").exists()
    # What is left is found and kept: the files of these tiles stay as they are until all are done.
    again = subprocess.run([*command, "-v"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert f"{len(done)} of 6 tiles are done already" in again.stderr
    assert not folder.exists()
    expected = estimate_normals(ball.points, execution=Execution(tile_points=1000, engine="serial"))
    assert np.array_equal(np.load(tmp_path / "out.npy")[:, 3:], expected.normals)
