"""A table of small files over all formats and dialects: each gives the same points, whatever it is written like."""

from __future__ import annotations

import struct
from pathlib import Path

import io_files as made
import laspy
import numpy as np
import pytest

from face_plugin.io import CLOUD_SUFFIXES, CloudFile, read_cloud, write_cloud

ALL = {f"text/{k}": v for k, v in made.TEXT.items()} | {f"coloured/{k}": v for k, v in made.COLOURED.items()}


def write(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_table_is_long_enough() -> None:
    assert len(ALL) + len(made.BINARY) >= 60


@pytest.mark.parametrize("name", ALL)
def test_text_of_every_dialect(tmp_path: Path, name: str) -> None:
    path = write(tmp_path / name.split("/")[1], ALL[name])
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.points, made.POINTS)
    assert cloud.normals is None
    if path.suffix == ".off":
        return
    # Written again, it is read again the same, with its other columns.
    write_cloud(path, cloud, normals=made.NORMALS)
    again = read_cloud(path)
    np.testing.assert_array_equal(again.points, made.POINTS)
    np.testing.assert_array_equal(again.normals, made.NORMALS)
    for old, new in zip(cloud.attributes.values(), again.attributes.values(), strict=True):
        np.testing.assert_array_equal(old, new)


@pytest.mark.parametrize("name", made.BINARY)
def test_binary_and_mesh_formats(tmp_path: Path, name: str) -> None:
    content = made.BINARY[name]()
    cloud = read_cloud(write(tmp_path / name, content))
    order = np.lexsort(cloud.points.T)
    np.testing.assert_allclose(cloud.points[order], made.POINTS[np.lexsort(made.POINTS.T)], rtol=0, atol=1e-9)
    if name.endswith((".pcd", ".ply", ".npy")):
        np.testing.assert_array_equal(cloud.points, made.POINTS)
    assert (len(cloud.problems) > 0) == (name.startswith("faces_"))


@pytest.mark.parametrize("name", made.COLOURED)
@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".pts", ".xyzrgb", ".las"])
def test_colours_arrive_as_bytes(tmp_path: Path, name: str, suffix: str) -> None:
    cloud = read_cloud(write(tmp_path / name, made.COLOURED[name]))
    write_cloud(tmp_path / f"out{suffix}", cloud)
    write_cloud(tmp_path / "out.ply", read_cloud(tmp_path / f"out{suffix}"))
    colours = read_cloud(tmp_path / "out.ply").attributes
    for k, channel in enumerate(("red", "green", "blue")):
        assert colours[channel].dtype == np.uint8
        np.testing.assert_array_equal(colours[channel], made.RGB[:, k])


@pytest.mark.parametrize("kind", ["u1", "u2", "i8", "f4", "f8"])
@pytest.mark.parametrize("names", ["red green blue", "R G B", "diffuse_red diffuse_green diffuse_blue", "colors"])
def test_colours_of_any_type_and_name(tmp_path: Path, kind: str, names: str) -> None:
    factor = {"u2": 257, "f4": 1 / 255, "f8": 1 / 255}.get(kind, 1)
    values = (made.RGB * factor).astype(kind)
    columns = dict(zip(names.split(), values.T, strict=False)) if " " in names else {names: values}
    write_cloud(tmp_path / "out.ply", CloudFile(made.POINTS, attributes={"quality": made.TIMES, **columns}))
    attributes = read_cloud(tmp_path / "out.ply").attributes
    assert list(attributes) == ["quality", "red", "green", "blue"]
    np.testing.assert_array_equal(np.stack([attributes[c] for c in ("red", "green", "blue")], axis=1), made.RGB)


def test_names_say_what_is_what(tmp_path: Path) -> None:
    path = write(tmp_path / "a.txt", made.TEXT["time_in_comment.txt"])
    np.testing.assert_array_equal(read_cloud(path).attributes["time"], made.TIMES)
    columns = made.rows("%d %.3f %.3f %.3f", made.TIMES, made.POINTS)
    for names in ("# time a b c", "GpsTime lon lat elevation", "# timestamp range azimuth polar", "# GPS time X Y Z"):
        write(path, made.lines(names, columns))
        with pytest.raises(ValueError, match=r"no numbers under x, y, z|5 column names for 4 columns") as caught:
            read_cloud(path)
        assert names.split()[-1] in str(caught.value)


def test_decimal_commas_are_written_again(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", made.TEXT["decimal_commas.csv"])
    write_cloud(path, read_cloud(path), normals=made.NORMALS)
    first = path.read_text().splitlines()[1].split(";")
    assert len(first) == 6
    assert all("," in word and "." not in word for word in first)


def test_viewpoints(tmp_path: Path) -> None:
    np.testing.assert_array_equal(
        read_cloud(write(tmp_path / "a.pcd", made.BINARY["ascii.pcd"]())).viewpoints, [[1, 2, 3]]
    )
    write_cloud(tmp_path / "b.pcd", read_cloud(tmp_path / "a.pcd"), normals=made.NORMALS)
    assert b"\nVIEWPOINT 1 2 3 1 0 0 0\n" in (tmp_path / "b.pcd").read_bytes()
    write(tmp_path / "c.pcd", made.BINARY["ascii.pcd"]().replace(b"VIEWPOINT 1 2 3", b"VIEWPOINT 0 0 0"))
    assert read_cloud(tmp_path / "c.pcd").viewpoints is None
    two = read_cloud(write(tmp_path / "a.ptx", made.ptx(3) + made.ptx(7)))
    np.testing.assert_array_equal(two.viewpoints, [[10, 20, 3], [10, 20, 7]])
    np.testing.assert_array_equal(two.attributes["scan"], np.repeat([0, 1], made.COUNT))
    np.testing.assert_array_equal(two.attributes["intensity"], np.full(2 * made.COUNT, 0.25))


def test_copc_and_plain_laz(tmp_path: Path) -> None:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [5e5, 6e5, 0]
    las = laspy.LasData(header)
    las.xyz = made.POINTS
    las.vlrs.append(laspy.VLR("copc", 1, "an octree", bytes(160)))
    las.write(tmp_path / "a.copc.laz")
    cloud = read_cloud(tmp_path / "a.copc.laz")
    np.testing.assert_allclose(cloud.points, made.POINTS, rtol=0, atol=1e-9)
    write_cloud(tmp_path / "b.laz", cloud, normals=made.NORMALS)
    # The octree is of the other file.
    assert [vlr.user_id for vlr in laspy.read(tmp_path / "b.laz").vlrs if vlr.user_id == "copc"] == []


def test_unknown_suffix_lists_what_can_be_read(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"'\.rcp'; allowed are .*\.pcd.*\.e57, \.ptx, \.off, \.stl"):
        read_cloud(tmp_path / "a.rcp")
    with pytest.raises(ValueError, match=r"'\.e57'; allowed are \.ply, \.pcd"):
        write_cloud(tmp_path / "a.e57", CloudFile(made.POINTS))
    assert ".stl" not in CLOUD_SUFFIXES


def test_places_of_a_grid_without_a_return_are_left_out(tmp_path: Path) -> None:
    grid = np.repeat(made.POINTS, 2, axis=0)
    grid[1::2, 2] = np.nan
    content = made.pcd("ascii", made.lines(made.rows("%.3f %.3f %.3f", grid)).encode())
    write(tmp_path / "a.pcd", content.replace(b" 40", b" 80"))
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.pcd").points, made.POINTS)


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
@pytest.mark.parametrize("kind", ["f2", ">f4", ">i8", "u2"])
def test_points_of_every_type_are_written(tmp_path: Path, suffix: str, kind: str) -> None:
    points = np.asfortranarray(np.arange(12).reshape(4, 3).astype(kind))
    write_cloud(tmp_path / f"a{suffix}", CloudFile(points))
    np.testing.assert_allclose(read_cloud(tmp_path / f"a{suffix}").points, points, rtol=0, atol=1e-8)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_polygons_of_many_lengths(tmp_path: Path, form: str) -> None:
    """Two lists a row, of lengths that change from row to row: all that was read is written again."""
    corners = [list(range(k % 4)) for k in range(300)]
    weights = [[0.5] * (k % 3) for k in range(300)]
    head = made.ply(
        form,
        more="element face 300\nproperty list uchar int vertex_indices\nproperty uchar flag\n"
        "property list ushort double weights\n",
    )
    order = ">" if "big" in form else "<"
    if form == "ascii":
        rows = [[len(a), *a, 7, len(b), *b] for a, b in zip(corners, weights, strict=True)]
        body = made.lines(made.XYZ, [" ".join(map(str, row)) for row in rows]).encode()
    else:
        body = made.BIG if order == ">" else made.LITTLE
        for a, b in zip(corners, weights, strict=True):
            body += struct.pack(f"{order}B{len(a)}iBH{len(b)}d", len(a), *a, 7, len(b), *b)
    path = write(tmp_path / "a.ply", head + body)
    write_cloud(path, read_cloud(path), normals=made.NORMALS)
    face = read_cloud(path).source["face"].data
    assert [row.tolist() for row in face["vertex_indices"]] == corners
    assert [row.tolist() for row in face["weights"]] == weights
    assert set(face["flag"].tolist()) == {7}
    write(path, (head + body)[:-9])
    assert len(read_cloud(path).source["face"].data) == 299
