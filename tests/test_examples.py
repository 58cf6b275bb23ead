"""Every example runs as a user runs it, and leaves its picture."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

EXAMPLES = Path(__file__).parents[1] / "examples"


def run(name, folder, *arguments):
    command = [sys.executable, str(EXAMPLES / name), "--out", str(folder), *arguments]
    # A folder of its own: an example that wrote beside the source would be found out.
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("name", "arguments", "files"),
    [
        ("numpy_only.py", ("--points", "1500"), {"numpy_only.png", "numpy_only_normals.npy"}),
        ("open3d_pipeline.py", ("--points", "1500"), {"open3d_pipeline.png", "open3d_pipeline.ply"}),
        ("open3d_dropin.py", ("--points", "800"), {"open3d_dropin.png"}),
        ("which_side.py", ("--points", "600", "--only", "terrain"), {"which_side_terrain.png"}),
        ("method_steps.py", ("--points", "2500"), {"method_steps.png"}),
        ("plane.py", ("--points", "60"), {"plane.png"}),
        ("meshlab_script.py", ("--points", "1500"), {"meshlab_script.png", "meshlab_script.ply"}),
    ],
)
def test_an_example_leaves_its_picture(tmp_path, name, arguments, files):
    run(name, tmp_path, *arguments)
    assert {path.name for path in tmp_path.iterdir()} == files
    picture = next(file for file in files if file.endswith(".png"))
    image = np.asarray(Image.open(tmp_path / picture).convert("L"))
    # An empty figure has two or three grey values and hardly any dark pixel.
    for panel in np.array_split(image, 2, axis=1):
        assert len(np.unique(panel)) > 30
        assert (panel < 200).mean() > 0.05


def test_the_drop_in_shows_what_it_is_for(tmp_path):
    out = run("open3d_dropin.py", tmp_path, "--points", "800")
    assert "installed(): 100.0 % of normals outward" in out
    assert "Open3D: 100.0 %" not in out
