"""`face` told where a scan was seen from: by options, by a file of positions, by the file itself."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from face_plugin import estimate_normals, shapes
from face_plugin.app.cli import main
from face_plugin.filters import Chain, Interior, Normals
from face_plugin.io import CloudFile, read_cloud, write_cloud

# A room scanned from inside: blind, its walls are those of a box.
ROOM = shapes.box(1200)
SHEET = np.stack(np.meshgrid(np.linspace(-1, 1, 25), np.linspace(-1, 1, 25)), axis=-1).reshape(-1, 2)
TERRAIN = np.column_stack([SHEET, 0.2 * np.sin(3 * SHEET[:, 0])])


def run(capfd: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = main([str(word) for word in words])
    out, err = capfd.readouterr()
    return code, out, err


def saved(folder: Path, points: np.ndarray, name: str = "in.npy") -> Path:
    np.save(folder / name, points)
    return folder / name


def inward(path: Path) -> bool:
    normals = read_cloud(path).normals
    assert normals is not None
    return bool(((normals * ROOM.normals).sum(axis=1) < 0).all())


def test_a_viewpoint_turns_a_room_inward(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    source, out = saved(tmp_path, ROOM.points), tmp_path / "out.ply"
    assert run(capfd, "normals", source, "-o", out)[0] == 0
    assert not inward(out)
    assert run(capfd, "normals", source, "-o", out, "--viewpoint", "-0.1,0,0.2", "--viewpoint", "0.2,0,0")[0] == 0
    assert inward(out)


def test_a_file_of_viewpoints(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    source, out, track = saved(tmp_path, ROOM.points), tmp_path / "out.ply", tmp_path / "track.csv"
    track.write_text("x,y,z\n-0.1,0,0\n0.1,0,0.1\n", encoding="utf-8")
    assert run(capfd, "normals", source, "-o", out, "--viewpoints", track)[0] == 0
    assert inward(out)


@pytest.mark.parametrize(("axis", "sign"), [("z", 1), ("-z", -1), ("0.1,0,2", 1), ("-0.1,0,-2", -1)])
def test_an_up_direction(axis: str, sign: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    source, out = saved(tmp_path, TERRAIN), tmp_path / "out.ply"
    assert run(capfd, "normals", source, "-o", out, "--up", axis)[0] == 0
    normals = read_cloud(out).normals
    assert normals is not None
    assert (normals[:, 2] * sign > 0).all()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--up", "w"], "invalid direction: x, y, z, -x, -y, -z or x,y,z value: 'w'"),
        (["--up", "0,0,0"], "invalid direction"),
        (["--viewpoint", "1,2"], "invalid position x,y,z value: '1,2'"),
        (["--viewpoint", "1,2,nan"], "invalid position"),
        (["--viewpoints", "nowhere.csv"], "nowhere.csv: No such file"),
    ],
)
def test_what_is_no_viewpoint_is_bad_input(
    words: list[str], message: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    code, _, err = run(capfd, "normals", saved(tmp_path, TERRAIN), "-o", tmp_path / "out.ply", *words)
    assert code == 2
    assert message in " ".join(err.split())


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """A scanner's own file, which says where the scanner stood."""
    path = tmp_path / "scan.pcd"
    write_cloud(path, CloudFile(ROOM.points, viewpoints=np.array([[0.1, 0.0, 0.0]])))
    return path


def test_the_files_own_viewpoint_is_used_and_said(scan: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out = scan.with_suffix(".ply")
    code, _, err = run(capfd, "normals", scan, "-o", out)
    assert code == 0
    assert inward(out)
    assert "the file says where it was seen from: 0.1, 0, 0" in err
    assert run(capfd, "normals", scan, "-o", out, "--quiet")[2] == ""
    _, _, err = run(capfd, "normals", scan, "-o", out, "--viewpoints", "none")
    assert not inward(out)
    assert "the file says" not in err
    # What is given comes first.
    _, _, err = run(capfd, "normals", scan, "-o", out, "--viewpoint", "50,0,0")
    assert not inward(out)
    assert "the file says" not in err


def test_a_chain_uses_it_too_unless_it_says_otherwise(scan: Path, capfd: pytest.CaptureFixture[str]) -> None:
    out, chain = scan.with_suffix(".ply"), scan.with_name("chain.toml")
    Chain([Interior(), Normals()]).save(chain)
    code, _, err = run(capfd, "chain", chain, scan, "-o", out)
    assert code == 0
    assert inward(out)
    assert "the file says" in err
    Chain([Interior(), Normals(viewpoints=[[50.0, 0.0, 0.0]])]).save(chain)
    assert run(capfd, "chain", chain, scan, "-o", out)[0] == 0
    assert not inward(out)


def test_a_mesh_of_a_room_is_made_from_all_of_it(scan: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("open3d")
    out, points = scan.with_name("mesh.ply"), scan.with_name("points.ply")
    code, text, _ = run(capfd, "mesh", scan, "-o", out, "--cloud", points, "--depth", 5, "--json")
    assert code == 0
    assert json.loads(text)["interior"] == 0
    assert inward(points)


def test_a_picture_and_a_sketch_take_them(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    source, out = saved(tmp_path, TERRAIN), tmp_path / "out.png"
    code, _, err = run(capfd, "plot", source, "-o", out, "--seen-up", "-z", "--up", "y")
    assert (code, out.exists()) == (0, True), err
    code, _, err = run(capfd, "ribbons", tmp_path / "none.obj", "-o", tmp_path / "m.ply", "--up", "-y")
    assert code == 2
    assert "none.obj" in err


def test_a_file_in_parts_has_sensors_and_strays(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    points = np.concatenate([shapes.box(2500).points, [[9.0, 0.0, 0.0], [0.0, 8.0, 0.0]]])
    source, out = saved(tmp_path, points), tmp_path / "out.ply"
    settings = ("--tile-points", 1500, "--engine", "serial")
    code, text, _ = run(
        capfd,
        "normals",
        source,
        "-o",
        out,
        "--resume",
        "--filter-interior",
        "--json",
        "--viewpoint",
        "0,0.1,0",
        *settings,
    )
    summary = json.loads(text)
    assert code == 0
    assert (summary["points"], summary["strays"], summary["interior"], summary["written"]) == (2502, 2, 0, 2500)
    cloud = read_cloud(out)
    assert cloud.normals is not None
    assert np.array_equal(cloud.points, points[:2500])
    assert ((cloud.normals * shapes.box(2500).normals).sum(axis=1) < 0).mean() > 0.999
    # Without the filter, all are written, and the strays are said all the same.
    _, text, _ = run(capfd, "normals", source, "-o", out, "--resume", "--json", *settings)
    assert (json.loads(text)["written"], json.loads(text)["strays"]) == (2502, 2)


def test_info_counts_strays(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    source = saved(tmp_path, np.concatenate([ROOM.points, [[9.0, 0.0, 0.0]]]))
    assert json.loads(run(capfd, "info", source, "--json")[1])["strays"] == 1
    assert run(capfd, "info", saved(tmp_path, np.zeros((2, 3)), "two.npy"))[0] == 0


def two_rooms() -> tuple[np.ndarray, np.ndarray]:
    """A ball that a sensor saw from inside, and one that another saw from outside, through the wall of the first."""
    ball = shapes.sphere(900)
    return np.concatenate([ball.points, ball.points + np.array([3.0, 0, 0])]), np.concatenate(
        [ball.points, ball.points]
    )


@pytest.mark.parametrize("suffix", ["ply", "npz", "csv"])
def test_a_column_says_which_viewpoint_saw_each_point(tmp_path, capfd, suffix) -> None:
    points, outward = two_rooms()
    rows = np.repeat([1, 0], 900).astype(np.int32)
    cloud, out = tmp_path / f"in.{suffix}", tmp_path / "out.ply"
    write_cloud(cloud, CloudFile(points, attributes={"scan": rows}))
    views = ["--viewpoint", "9,0,0", "--viewpoint", "0,0,0", "--seen-from", "scan"]
    assert run(capfd, "normals", cloud, "-o", out, "--quiet", *views) == (0, "", "")
    expected = estimate_normals(read_cloud(cloud).points, viewpoints=[[9, 0, 0], [0, 0, 0]], seen_from=rows)
    np.testing.assert_allclose(read_cloud(out).normals, expected.normals, atol=1e-6)
    assert ((read_cloud(out).normals * outward).sum(axis=1)[:900] < 0).all()


@pytest.mark.parametrize(
    ("column", "views", "message"),
    [
        ("when", ["--viewpoint", "0,0,0"], "--seen-from must name a column of the input, found 'when'; there are scan"),
        ("share", ["--viewpoint", "0,0,0"], "--seen-from must name a column of whole numbers, found 'share'"),
        ("scan", ["--viewpoint", "0,0,0"], "seen_from must hold rows of viewpoints, 0 to 0, or -1; found 0 to 1"),
        ("scan", [], "viewpoints or up must be given with seen_from"),
    ],
)
def test_a_column_that_does_not_fit_is_named(tmp_path, capfd, column, views, message) -> None:
    points, _ = two_rooms()
    cloud = tmp_path / "in.npz"
    rows = np.repeat([1, 0], 900)
    write_cloud(cloud, CloudFile(points, attributes={"scan": rows, "share": rows + 0.5}))
    code, _, err = run(capfd, "normals", cloud, "-o", tmp_path / "out.ply", "--seen-from", column, *views)
    assert code != 0
    assert message in err


def test_a_column_needs_the_cloud_in_one_piece(tmp_path, capfd) -> None:
    points, _ = two_rooms()
    words = ["normals", saved(tmp_path, points), "-o", tmp_path / "out.npy", "--resume", "--viewpoint", "0,0,0"]
    code, _, err = run(capfd, *words, "--seen-from", "scan")
    assert code != 0
    assert "--seen-from needs a cloud with columns, in one piece" in err
