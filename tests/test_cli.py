"""`face` as a person meets it: results, summaries, settings."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from command import run

from face_plugin import Params, shapes
from face_plugin.app.cli import build_parser, main
from face_plugin.app.cli.options import params_of
from face_plugin.io import CloudFile, read_cloud, write_cloud
from face_plugin.params import CHOICES

BALL = shapes.sphere(600)
NESTED = shapes.nested_box(3000)


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "ball.ply"
    write_cloud(path, CloudFile(BALL.points.astype(np.float32), attributes={"label": np.arange(600)}))
    return path


@pytest.fixture
def nested(tmp_path: Path) -> Path:
    path = tmp_path / "nested.npy"
    np.save(path, NESTED.points)
    return path


def test_normals_point_outward_and_the_rest_is_kept(ball: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out = ball.with_name("out.ply")
    code, text, err = run(capfd, "normals", ball, "-o", out, "--scalars")
    assert code == 0
    assert "600 points with normals" in text
    assert "poisson" in err
    cloud = read_cloud(out)
    assert cloud.normals is not None
    assert cloud.normals.dtype == np.float32
    assert ((cloud.normals * BALL.normals).sum(axis=1) > 0.5).all()
    np.testing.assert_array_equal(cloud.attributes["label"], np.arange(600))
    assert (cloud.attributes["strength"] > 0).all()
    assert set(cloud.attributes) == {"label", "strength", "confidence", "sides"}


def test_the_input_may_be_the_output(ball: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(capfd, "normals", ball, "-o", ball)[0] == 0
    assert read_cloud(ball).normals is not None


def test_interior_points_are_marked_or_left_out(nested: Path, capfd: pytest.CaptureFixture[str]) -> None:
    marked, outer = nested.with_name("marked.npz"), nested.with_name("outer.npz")
    assert run(capfd, "normals", nested, "-o", marked, "--mark-interior")[0] == 0
    code, text, _ = run(capfd, "normals", nested, "-o", outer, "--filter-interior", "--json")
    assert code == 0
    inside = read_cloud(marked).attributes["interior"].astype(bool)
    # The box lies deeper than two spacings: there the filter is to be right for 99 of 100 points.
    assert (inside == NESTED.interior).mean() >= 0.99
    assert json.loads(text)["written"] == len(read_cloud(outer)) == (~inside).sum()


def test_mesh_is_closed_and_is_the_outer_surface(nested: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out, cloud = nested.with_name("mesh.stl"), nested.with_name("cloud.xyz")
    code, text, _ = run(capfd, "mesh", nested, "-o", out, "--depth", 6, "--cloud", cloud, "--json")
    assert code == 0
    summary = json.loads(text)
    assert summary["closed"] is True
    assert summary["kept"] + summary["dropped"] == 3000
    mesh = trimesh.load_mesh(out)
    assert mesh.is_watertight
    assert len(mesh.faces) == summary["faces"]
    # A ball without the box in it; the octree's cell is a 64th, and the surface may lie off by a third of it.
    assert mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.02)
    kept = read_cloud(cloud)
    assert len(kept) == summary["kept"]
    assert kept.normals is not None


@pytest.mark.parametrize("options", [["--unscreened"], ["--backend", "pymeshlab"], ["--trim", "0.1"]])
def test_surface_options_reach_the_reconstruction(
    ball: Path, capfd: pytest.CaptureFixture[str], options: list[str]
) -> None:
    common = ["mesh", ball, "--depth", 5, "--no-filter-interior", "--quiet", "-o"]
    plain, varied = ball.with_name("plain.off"), ball.with_name("varied.off")
    assert run(capfd, *common, plain) == (0, "", "")
    assert run(capfd, *common, varied, *options)[0] == 0
    assert plain.read_bytes() != varied.read_bytes()


def test_json_is_all_there_is_on_stdout(ball: Path) -> None:
    words = ["normals", str(ball), "-o", str(ball.with_name("out.npy")), "--json", "--seed", "3"]
    done = subprocess.run([sys.executable, "-m", "face_plugin.app.cli", *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["command"] == "normals"
    assert summary["points"] == 600
    assert summary["params"]["seed"] == 3
    assert set(summary["timings"]) >= {"mesh", "poisson", "normals"}
    assert summary["seconds"] >= sum(summary["timings"].values())


def test_info(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    points = np.concatenate([grid, grid[:2], [[np.nan, 0, 0]]])
    write_cloud(tmp_path / "a.csv", CloudFile(points, attributes={"label": np.arange(67)}))
    code, text, _ = run(capfd, "info", tmp_path / "a.csv", "--json")
    found = json.loads(text)
    assert code == 0
    assert (found["points"], found["non_finite"], found["duplicates"]) == (67, 1, 2)
    assert (found["lower"], found["upper"]) == ([0.0] * 3, [3.0] * 3)
    assert found["spacing"] == 1.0
    assert found["normals"] is False
    assert list(found["attributes"]) == ["label"]
    code, text, _ = run(capfd, "info", tmp_path / "a.csv")
    assert "duplicates   2" in text


def test_plot(ball: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out = ball.with_name("picture.png")
    code, text, _ = run(capfd, "plot", ball, "-o", out, "--view", "10,20", "--up", "y", "--axis", "x")
    assert code == 0
    assert out.read_bytes().startswith(b"\x89PNG")
    assert "picture of 600 points" in text


def test_plot_of_the_interior_filter(nested: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out = nested.with_name("picture.png")
    assert run(capfd, "plot", "--interior", nested, "-o", out, "--depth", 5)[0] == 0
    assert out.read_bytes().startswith(b"\x89PNG")


CANDIDATES = [0.31, 7, 2000, "serial", *(word for words in CHOICES.values() for word in words)]


def another_value(name: str) -> Any:
    """Return a value that a field may have and does not have by default."""
    for value in CANDIDATES:
        try:
            if getattr(Params(**{name: value}), name) != getattr(Params(), name):
                return value
        except (ValueError, TypeError):
            continue
    raise AssertionError(f"no value for {name}")


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(Params)])
def test_every_setting_is_an_option(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    parser = build_parser()
    words = ["normals", "a.ply", "-o", "b.ply"]
    assert params_of(parser.parse_args(words)) == Params()
    flag = "--" + name.replace("_", "-")
    value = another_value(name)
    args = parser.parse_args([*words, flag, str(value)])
    assert params_of(args) == Params(**{name: value})
    assert main(["normals", "--help"]) == 0
    text = capfd.readouterr().out
    assert flag in text
    assert "None" not in text


def test_alpha_by_name_and_the_settings_of_the_paper() -> None:
    words = ["mesh", "a.ply", "-o", "b.ply", "--alpha", "sparse"]
    assert params_of(build_parser().parse_args(words)).alpha == "sparse"
    args = build_parser().parse_args([*words, "--paper", "--seed", "4"])
    assert params_of(args) == Params.paper(alpha="sparse", seed=4)


def test_help_documents_the_exit_codes(capfd: pytest.CaptureFixture[str]) -> None:
    code, text, _ = run(capfd, "--help")
    assert code == 0
    for number in ("0 ", "1 ", "2 ", "3 ", "130 "):
        assert f"\n  {number}" in text
