"""`face view`: pictures, and what it refuses."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from face_plugin import shapes
from face_plugin.app.cli import main
from face_plugin.app.viewer.session import Session
from face_plugin.sculpt import SculptFile


def test_a_bad_sculpt_file_is_said_before_the_cage_is_solved(tmp_path):
    stages = []
    (tmp_path / "edits.json").write_text("{}")
    with pytest.raises(ValueError, match="the field 'version' is missing"):
        Session(shapes.sphere(200).points, sculpt=tmp_path / "edits.json", progress=lambda *a: stages.append(a))
    assert stages == []


def test_a_picture_from_the_command_line(tmp_path, capsys):
    np.save(tmp_path / "shell.npy", shapes.spherical_shell(400).points)
    SculptFile(charges=((0.0, 0.0, 0.0),)).save(tmp_path / "edits.json")
    words = ["view", tmp_path / "shell.npy", "--sculpt", tmp_path / "edits.json", "--up", "y"]
    words += ["--cut", "z", "--screenshot", tmp_path / "shell.png", "--json", "--quiet"]
    assert main([str(word) for word in words]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["points"], summary["charges"], summary["cage_points"]) == (400, 1, 0)
    picture = np.asarray(Image.open(tmp_path / "shell.png").convert("RGB"))
    assert (np.ptp(picture, axis=2) > 20).mean() > 0.02


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--screenshot", "shot.gif"], "allowed are .png, .jpg"),
        (["--save-mesh", "mesh.xyz"], "allowed are .ply"),
        (["--save-sculpt", "edits.ply"], "allowed are .json"),
        (["--save-viewpoints", "views.gif"], "allowed are .ply"),
    ],
)
def test_bad_names_are_said_at_once(tmp_path, capsys, words, message):
    assert main(["view", str(tmp_path / "missing.npy"), *words]) == 2
    assert message in capsys.readouterr().err


def test_without_polyscope(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "polyscope", None)
    assert main(["view", str(tmp_path / "missing.npy")]) == 3
    assert "pip install 'face-plugin[viewer]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ([], 1, "there is no display to open a window on"),
        (["--screenshot", "shot.png"], 3, "apt-get install libegl1 libgl1 libx11-6"),
    ],
)
def test_without_a_display_or_a_renderer(tmp_path, words, code, message):
    np.save(tmp_path / "ball.npy", shapes.sphere(100).points)
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "XDG_SESSION_TYPE")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    # A folder without drivers, as on a machine that has none.
    environment["__EGL_VENDOR_LIBRARY_FILENAMES"] = str(tmp_path / "none.json")
    done = subprocess.run(
        [sys.executable, "-m", "face_plugin.app.cli", "view", "ball.npy", "--quiet", *words],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == code, done.stderr
    assert message in done.stderr
    assert not (tmp_path / "shot.png").exists()
