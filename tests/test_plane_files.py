"""Points in the plane from files, in the shell, in chains and in pictures."""

import json

import numpy as np
import pytest

from face_plugin.app.cli import main
from face_plugin.app.plot import plot_curves
from face_plugin.filters import Interior, Normals, PointSet, Reconstruct
from face_plugin.io import CLOUD_SUFFIXES, PLANE_SUFFIXES, CloudFile, read_cloud, write_cloud
from face_plugin.shapes.curves import nested_circles, star

POINTS = np.array([[0.5, 1.0], [2.25, -3.0], [4.0, 0.125]])
NORMALS = np.array([[1.0, 0.0], [0.0, -1.0], [0.6, 0.8]])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.txt", "0.5 1\n2.25 -3\n4 0.125\n"),
        ("a.csv", "0.5,1\n2.25,-3\n4,0.125\n"),
        ("a.csv", "x;y\n0,5;1,0\n2,25;-3,0\n4,0;0,125\n"),
        ("a.csv", "id,X,Y\n1,0.5,1\n2,2.25,-3\n3,4,0.125\n"),
        ("a.asc", "# an outline\n0.5\t1\n2.25\t-3\n4\t0.125\n"),
        ("a.txt", "# x y nx ny width\n0.5 1 1 0 7\n2.25 -3 0 -1 7\n4 0.125 0.6 0.8 7\n"),
    ],
)
def test_two_columns_of_text(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    cloud = read_cloud(tmp_path / name)
    np.testing.assert_array_equal(cloud.points, POINTS)
    if "nx" in text:
        np.testing.assert_array_equal(cloud.normals, NORMALS)
        assert list(cloud.attributes) == ["width"]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        # What may be a height is none that is left out in silence.
        ("a.csv", "x,y,depth\n1,2,3\n", "no numbers under x, y, z"),
        ("a.xyz", "1 2\n3 4\n", "line 1 has 2 columns"),
        ("a.txt", "1\n2\n", "line 1 has 1 columns"),
        ("a.txt", "1 2\n3 4 5\n6 7 8\n", None),
    ],
)
def test_what_is_no_plane(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    if message is None:
        # The first line is a title: rows of three are points in space.
        assert read_cloud(tmp_path / name).points.shape == (2, 3)
    else:
        with pytest.raises(ValueError, match=message):
            read_cloud(tmp_path / name)


@pytest.mark.parametrize("normals", [None, NORMALS])
@pytest.mark.parametrize("suffix", PLANE_SUFFIXES)
def test_what_is_written_is_read_back(tmp_path, suffix, normals):
    first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    write_cloud(first, CloudFile(POINTS))
    write_cloud(second, read_cloud(first), normals=normals)
    write_cloud(first, read_cloud(second), keep=np.array([True, False, True]))
    for path, kept in ((second, [0, 1, 2]), (first, [0, 2])):
        cloud = read_cloud(path)
        np.testing.assert_array_equal(cloud.points, POINTS[kept])
        if normals is None:
            assert cloud.normals is None
        else:
            np.testing.assert_array_equal(cloud.normals, normals[kept])


@pytest.mark.parametrize("suffix", sorted(set(CLOUD_SUFFIXES) - set(PLANE_SUFFIXES)))
def test_other_files_are_refused(tmp_path, suffix):
    with pytest.raises(ValueError, match=r"points in the plane go to \.txt, \.csv"):
        write_cloud(tmp_path / f"a{suffix}", CloudFile(POINTS))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".txt", ".npy"])
def test_the_shell_gives_normals(tmp_path, suffix, capsys):
    shape = nested_circles(300)
    source, output = tmp_path / f"in{suffix}", tmp_path / f"out{suffix}"
    write_cloud(source, CloudFile(shape.points))
    assert main(["normals", str(source), "-o", str(output), "--mark-interior", "--scalars", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["interior"] == shape.interior.sum()
    cloud = read_cloud(output)
    assert (np.einsum("nd,nd->n", cloud.normals, shape.normals) > 0).all()
    np.testing.assert_array_equal(cloud.attributes["interior"].astype(bool), shape.interior)
    assert main(["info", str(output)]) == 0
    assert main(["plot", str(output), "-o", str(tmp_path / "a.png"), "--interior"]) == 0
    assert (tmp_path / "a.png").stat().st_size > 10_000


@pytest.mark.parametrize(("command", "output"), [("mesh", "a.ply"), ("normals", "a.ply")])
def test_the_shell_says_what_is_not_there(tmp_path, command, output, capsys):
    source = tmp_path / "in.txt"
    write_cloud(source, CloudFile(star(100).points))
    assert main([command, str(source), "-o", str(tmp_path / output)]) != 0
    assert "in the plane" in capsys.readouterr().err


def test_steps_of_a_chain():
    shape = nested_circles(300)
    layer = Interior()(Normals()(PointSet(shape.points)))
    np.testing.assert_array_equal(layer.keep, ~shape.interior)
    assert (np.einsum("nd,nd->n", layer.normals, shape.normals) > 0).all()
    with pytest.raises(ValueError, match="in the plane there are normals, interior points and the field"):
        Reconstruct()(layer)


def test_a_picture_marks_what_is_inside():
    shape = nested_circles(100)
    figure = plot_curves(shape.points, shape.normals, lambda p: np.hypot(*p.T), interior=shape.interior, alpha=0.5)
    kept, inside = (marks.get_offsets() for marks in figure.axes[1].collections[::2])
    np.testing.assert_array_equal(kept, shape.points[~shape.interior])
    np.testing.assert_array_equal(inside, shape.points[shape.interior])
