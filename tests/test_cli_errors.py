"""`face` when something is wrong: messages, exit codes, what an interrupt leaves."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command import run

from face_plugin import MeshingError, estimate, shapes
from face_plugin.io import CloudFile, write_cloud

BALL = shapes.sphere(600)


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "ball.ply"
    write_cloud(path, CloudFile(BALL.points))
    return path


MISTAKES = {
    "no such file": (["normals", "none.ply", "-o", "out.ply"], "none.ply: No such file"),
    "unknown input": (["info", "cloud.dwg"], "extension '.dwg'; allowed are .ply"),
    "unknown output": (["mesh", "ball.ply", "-o", "out.docx"], "allowed are .ply, .obj, .stl, .off"),
    "no folder": (["normals", "ball.ply", "-o", "no/out.ply"], "there is no folder"),
    "broken file": (["normals", "broken.ply", "-o", "out.ply"], "broken.ply: not a readable PLY"),
    "setting out of range": (
        ["normals", "ball.ply", "-o", "out.ply", "--alpha", "3"],
        "alpha must be in (0, 1)",
    ),
    "depth out of range": (["mesh", "ball.ply", "-o", "out.ply", "--depth", "40"], "argument --depth"),
    "points that are not finite": (
        ["normals", "nan.npy", "-o", "out.ply"],
        "NaN or infinity in 1 of 5 rows: 4",
    ),
    "too few points": (["normals", "few.npy", "-o", "out.ply"], "points"),
    "unknown option": (["normals", "ball.ply", "-o", "out.ply", "--speed", "9"], "--speed"),
    "no command": ([], "COMMAND"),
    "value of no type": (["normals", "ball.ply", "-o", "out.ply", "--seed", "many"], "--seed"),
    "no output": (["mesh", "ball.ply"], "-o/--output"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named_without_a_traceback(
    ball: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], mistake: str
) -> None:
    words, message = MISTAKES[mistake]
    monkeypatch.chdir(ball.parent)
    Path("broken.ply").write_bytes(b"ply\nnonsense")
    np.save("nan.npy", np.concatenate([np.eye(3), np.ones((1, 3)), [[0, np.inf, 0]]]))
    np.save("few.npy", np.eye(3))
    before = sorted(os.listdir())
    code, out, err = run(capfd, *words)
    assert code == 2
    assert out == ""
    assert message in err
    assert "Traceback" not in err
    assert sorted(os.listdir()) == before


def test_verbose_shows_where_an_error_comes_from(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capfd, "info", tmp_path / "none.ply", "-v")
    assert code == 2
    assert "Traceback" in err
    assert err.rstrip().splitlines()[-1].endswith("none.ply: No such file or directory")


def test_errors_are_json_too(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    code, text, _ = run(capfd, "info", tmp_path / "none.ply", "--json")
    assert json.loads(text)["exit_code"] == code == 2


def test_a_missing_package_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    # None is how Python itself marks a module that must not be found.
    monkeypatch.setitem(sys.modules, "laspy", None)
    (tmp_path / "a.las").write_bytes(b"LASF")
    code, _, err = run(capfd, "info", tmp_path / "a.las")
    assert code == 3
    assert "pip install 'face-plugin[las]'" in err


def test_a_failure_of_the_method(
    ball: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise MeshingError("no tetrahedra")

    monkeypatch.setattr(estimate, "estimate_normals", fail)
    out = ball.with_name("out.ply")
    out.write_bytes(b"what was there")
    code, _, err = run(capfd, "normals", ball, "-o", out)
    assert code == 1
    assert err.rstrip().endswith("face: error: no tetrahedra")
    assert out.read_bytes() == b"what was there"


def hear_interrupts() -> None:
    """Undo what shells do to commands in the background, whose children inherit deaf ears."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_leaves_nothing_behind(tmp_path: Path, number: signal.Signals, code: int) -> None:
    source, out = tmp_path / "in.npy", tmp_path / "out.ply"
    np.save(source, shapes.sphere(20_000).points)
    words = [sys.executable, "-m", "face_plugin.app.cli", "normals", str(source), "-o", str(out), "-v"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, preexec_fn=hear_interrupts) as process:
        assert process.stderr is not None
        # The first stage has been timed: the computation is under way.
        seen = []
        for line in process.stderr:
            seen.append(line)
            if "cloud:" in line:
                break
        process.send_signal(number)
        seen += process.stderr.readlines()
    assert process.returncode == code, "".join(seen)
    assert "Traceback" not in "".join(seen)
    assert os.listdir(tmp_path) == ["in.npy"]


def test_an_interrupt_while_writing_leaves_the_old_file(tmp_path: Path) -> None:
    out = tmp_path / "out.xyz"
    out.write_text("what was there")
    program = (
        "import numpy, sys; from face_plugin.io import CloudFile, write_cloud; "
        "write_cloud(sys.argv[1], CloudFile(numpy.random.default_rng(0).random((2_000_000, 3))))"
    )
    words = [sys.executable, "-c", program, str(out)]
    with subprocess.Popen(words, stderr=subprocess.PIPE, preexec_fn=hear_interrupts) as process:
        while process.poll() is None and len(os.listdir(tmp_path)) == 1:
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
    assert process.returncode != 0
    assert os.listdir(tmp_path) == ["out.xyz"]
    assert out.read_text() == "what was there"
