"""The disk: full, or shared with another run into the same output; and work to go on from that is damaged."""

from __future__ import annotations

import dataclasses
import errno
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from face_plugin import Execution, shapes
from face_plugin.io import disk
from face_plugin.tiles import files
from face_plugin.tiles.engines import Serial
from face_plugin.tiles.files import normals_of_file, work_folder

EXECUTION = Execution(tile_points=1250, engine="serial")
FACE = [sys.executable, "-m", "face_plugin.app.cli"]


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "in.npy"
    np.save(path, shapes.sphere(2500).points)
    return path


@pytest.mark.parametrize("reserves", [True, False])
def test_what_is_mapped_has_its_place_on_the_disk(tmp_path, monkeypatch, reserves):
    """A sparse file on a disk that turns out to be full ends the process: nothing in Python can catch that."""
    if not reserves:

        def refuse(*args):
            raise OSError(errno.EOPNOTSUPP, "not on this file system")

        monkeypatch.setattr(os, "posix_fallocate", refuse)
    made = disk.allocated(tmp_path / "a.npy", np.float32, (400_000, 3))
    assert os.stat(tmp_path / "a.npy").st_blocks * 512 >= 4_800_000
    made[7] = 5
    made.flush()
    again = np.load(tmp_path / "a.npy")
    assert again.shape == (400_000, 3)
    assert again.sum() == 15


@pytest.mark.parametrize("call", [0, 1, 4])
def test_a_full_disk_names_the_output_and_keeps_the_old_one(source, tmp_path, monkeypatch, call):
    out, calls = tmp_path / "out.npy", []
    out.write_bytes(b"what was there")
    real = os.posix_fallocate

    def fill_up(*args):
        calls.append(args)
        if len(calls) > call:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(*args)

    monkeypatch.setattr(os, "posix_fallocate", fill_up)
    with pytest.raises(OSError, match="No space left") as caught:
        normals_of_file(source, out, execution=EXECUTION)
    assert caught.value.filename == str(out)
    assert out.read_bytes() == b"what was there"
    # Tiles that are done are worth keeping; what came before them is not.
    kept = [work_folder(out).name] if call > 1 else []
    assert sorted(os.listdir(tmp_path)) == [*kept, "in.npy", "out.npy"]


def test_no_room_for_what_tiles_say(source, tmp_path):
    """The limit on a file's size hits the files that are written, not mapped."""
    words = [*FACE, "normals", str(source), "-o", str(tmp_path / "out.npy"), "--resume", "--tile-points", "1250"]
    words += ["--engine", "serial", "--quiet"]

    def limit() -> None:
        # The points take 60 kB, what is known of a tile's 1250 points more.
        resource.setrlimit(resource.RLIMIT_FSIZE, (70_000, 70_000))

    done = subprocess.run(words, capture_output=True, text=True, preexec_fn=limit)
    assert done.returncode == 2
    assert done.stderr == f"face: error: {tmp_path / 'out.npy'}: File too large\n"


def test_one_run_at_a_time_into_an_output(source, tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "PATIENCE", 0.0)
    out = tmp_path / "out.npy"
    folder = work_folder(out)
    asked = []

    class Another(Serial):
        def run(self, job, folder, tiles, done):
            if not asked:
                asked.append(sorted(path.name for path in Path(folder).iterdir()))
                for resume in (False, True):
                    with pytest.raises(BlockingIOError, match=f"another run is writing {out}"):
                        normals_of_file(source, out, execution=EXECUTION, resume=resume)
                asked.append(sorted(path.name for path in Path(folder).iterdir()))
            super().run(job, folder, tiles, done)

    assert normals_of_file(source, out, execution=dataclasses.replace(EXECUTION, engine=Another())).written == 2500
    assert asked[0] == asked[1]
    assert not folder.exists()
    assert sorted(os.listdir(tmp_path)) == ["in.npy", "out.npy"]
    assert normals_of_file(source, out, execution=EXECUTION).written == 2500


def test_the_lock_goes_with_the_run_that_held_it(tmp_path):
    lock, out = tmp_path / ".out.lock", tmp_path / "out.npy"
    program = (
        "import sys, time, pathlib; from face_plugin.io.disk import claimed\n"
        "with claimed(pathlib.Path(sys.argv[1]), pathlib.Path('out')): print('held', flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program, str(lock)], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(BlockingIOError), disk.claimed(lock, out):
            pass
        holder.send_signal(signal.SIGKILL)
    assert lock.exists()
    with disk.claimed(lock, out):
        pass
    assert not lock.exists()


def test_a_lock_that_is_a_link_is_not_followed(tmp_path):
    (tmp_path / "lock").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="symbolic links"), disk.claimed(tmp_path / "lock", tmp_path / "out"):
        pass
    assert not (tmp_path / "elsewhere").exists()


def test_a_file_system_without_locks_is_said_and_used(tmp_path, monkeypatch, caplog):
    import fcntl

    def refuse(*args):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    monkeypatch.setattr(disk, "_lock", lambda file, take: refuse() if take else None)
    with disk.claimed(tmp_path / "lock", tmp_path / "out"):
        pass
    assert "no locks on this file system" in caplog.text


class Stopping(Serial):
    """An engine that is interrupted after the first tile."""

    def run(self, job, folder, tiles, done):
        job(folder, tiles[0])
        raise KeyboardInterrupt


@pytest.mark.parametrize("damaged", ["store.json", "points.npy", "voxels.npz", "field"])
@pytest.mark.parametrize("harm", ["cut", "noise"])
def test_damaged_work_is_not_gone_on_from(source, tmp_path, damaged, harm):
    out = tmp_path / "out.npy"
    with pytest.raises(KeyboardInterrupt):
        normals_of_file(source, out, execution=dataclasses.replace(EXECUTION, engine=Stopping()))
    (path,) = work_folder(out).glob(f"{damaged}*")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 3] if harm == "cut" else b"\x93" + bytes(len(content) - 1))
    with pytest.raises(ValueError, match=rf"{path.name}: nothing to go on from \(.*: remove .*, or do not resume"):
        normals_of_file(source, out, execution=EXECUTION, resume=True)
    assert normals_of_file(source, out, execution=EXECUTION).written == 2500
    assert files.work_folder(out).exists() is False
