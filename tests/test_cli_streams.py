"""`face` whose standard streams are closed or full, and which is interrupted while it loads."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from face_plugin import shapes

FACE = [sys.executable, "-m", "face_plugin.app.cli"]


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "ball.npy"
    np.save(path, shapes.sphere(300).points)
    return path


def closing(*numbers: int):
    def close() -> None:
        for number in numbers:
            os.close(number)

    return close


@pytest.mark.parametrize(("closed", "told"), [((1,), True), ((0, 1), True), ((1, 2), False), ((0, 1, 2), False)])
def test_a_result_that_nobody_can_get_is_an_error(ball, closed, told):
    with open(ball.with_name("said"), "w") as said:
        done = subprocess.run([*FACE, "info", str(ball)], stderr=said, preexec_fn=closing(*closed))
    assert done.returncode == 2
    expected = "face: error: standard output: Bad file descriptor\n" if told else ""
    assert ball.with_name("said").read_text() == expected


@pytest.mark.parametrize("words", [["info", "ball.npy"], ["info", "ball.npy", "--json"], ["--version"], ["--help"]])
def test_a_full_standard_output(ball, words):
    with open("/dev/full", "w") as full:
        done = subprocess.run([*FACE, *words], stdout=full, stderr=subprocess.PIPE, text=True, cwd=ball.parent)
    assert done.returncode == 2
    assert done.stderr == "face: error: standard output: No space left on device\n"


@pytest.mark.parametrize("closed", [(), (0, 2)], ids=["full", "closed"])
def test_messages_that_nobody_can_get_are_no_error(ball, closed):
    """Nothing else may come to stand under the number of a closed stream: what is printed would be in it."""
    out = ball.with_name("out.ply")
    with open("/dev/full", "w") as full:
        words = [*FACE, "normals", str(ball), "-o", str(out), "-v"]
        done = subprocess.run(words, stdout=subprocess.PIPE, stderr=full, text=True, preexec_fn=closing(*closed))
    assert done.returncode == 0
    assert done.stdout == f"{out}: 300 points with normals\n"
    assert out.read_bytes().startswith(b"ply\nformat binary_little_endian")
    with open("/dev/full", "w") as full:
        done = subprocess.run([*FACE, "info", "--no-such-option"], stderr=full, preexec_fn=closing(*closed))
    assert done.returncode == 2


@pytest.mark.parametrize("module", ["argparse", "numpy", "scipy.spatial", "numba"])
@pytest.mark.parametrize("turned", ["raised", "turned", "dropped"])
def test_an_interrupt_while_loading(ball, module, turned):
    """Libraries that are interrupted while they load may raise what they like."""
    program = f"""
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Freed:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
class Interrupting:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            if {turned!r} == "dropped":
                return Freed() and None
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                if {turned!r} == "raised":
                    raise
                raise ImportError("no such luck")
from face_plugin.app.cli import main
sys.modules.pop({module!r}, None)
sys.meta_path.insert(0, Interrupting())
sys.exit(main(["normals", sys.argv[1], "-o", sys.argv[2], "--quiet"]))
"""
    out = ball.with_name("out.ply")
    done = subprocess.run([sys.executable, "-c", program, str(ball), str(out)], capture_output=True, text=True)
    assert done.returncode == 130
    assert done.stderr == "face: error: interrupted\n"
    assert os.listdir(ball.parent) == ["ball.npy"]
