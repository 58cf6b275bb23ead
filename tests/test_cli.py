"""`face` as a person meets it: results, summaries, messages, exit codes, what an interrupt leaves."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from face_plugin import MeshingError, Params, estimate, shapes
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


def run(capfd: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = main([str(word) for word in words])
    out, err = capfd.readouterr()
    return code, out, err


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
