"""Files: what survives a round trip, what a broken file says, and that nothing half-written stays."""

from __future__ import annotations

import struct
from pathlib import Path

import laspy
import numpy as np
import pytest
import trimesh

from face_plugin.io import (
    CLOUD_SUFFIXES,
    MESH_SUFFIXES,
    CloudFile,
    read_cloud,
    write_cloud,
    write_mesh,
)
from face_plugin.io.plydata import PlyData
from face_plugin.io.plyread import read_data

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(7, 3))
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
PLY_KINDS = {"ascii": (True, "="), "little": (False, "<"), "big": (False, ">")}


def coloured_ply(path: Path, kind: str, *, with_normals: bool = False, faces: object = None) -> None:
    """Write a PLY by hand: float positions, colour, quality, faces, edges, comments."""
    text, order = PLY_KINDS[kind]
    names = ["x", "y", "z", "red", "quality"] + (["nx", "ny", "nz"] if with_normals else [])
    types = ["f", "f", "f", "B", "d"] + (["f"] * 3 if with_normals else [])
    words = {"f": "float", "B": "uchar", "d": "double"}
    head = ["ply", "format " + {"=": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order] + " 1.0"]
    head += ["comment made by a scanner", "element vertex 7"]
    head += [f"property {words[t]} {n}" for n, t in zip(names, types, strict=True)]
    head += ["element face 3", "property list uchar int vertex_indices", "property uchar flags"]
    head += ["element edge 2", "property int vertex1", "property int vertex2", "end_header"]
    rows: list[tuple[str, list[float]]] = []
    for k, point in enumerate(POINTS):
        rows.append(("".join(types), [*point, k * 30, np.linspace(0, 1, 7)[k]] + [0.0] * (3 * with_normals)))
    for flag, face in zip((7, 8, 9), faces or ([0, 1, 2], [2, 3, 4], [4, 5, 6]), strict=True):
        rows.append((f"B{len(face)}iB", [len(face), *face, flag]))
    rows += [("ii", [0, 6]), ("ii", [1, 2])]
    if text:
        body = "".join(" ".join(map(str, values)) + "\n" for _, values in rows).encode()
    else:
        body = b"".join(struct.pack(order + form, *values) for form, values in rows)
    path.write_bytes("\n".join([*head, ""]).encode() + body)


def plain_ply(path: Path) -> PlyData:
    """What a PLY file holds, read by the project's own reader, which test_io_hosts holds against others."""
    return read_data(path)


@pytest.mark.parametrize("kind", PLY_KINDS)
@pytest.mark.parametrize("polygons", [False, True])
def test_ply_keeps_everything_but_the_normals(tmp_path: Path, kind: str, polygons: bool) -> None:
    path = tmp_path / "scan.ply"
    coloured_ply(path, kind, faces=([0, 1, 2, 3], [2, 3, 4], [4, 5, 6]) if polygons else None)
    cloud = read_cloud(path)
    assert cloud.points.dtype == np.float32
    np.testing.assert_array_equal(cloud.points, POINTS.astype(np.float32))
    assert cloud.normals is None
    assert set(cloud.attributes) == {"red", "quality"}

    write_cloud(path, cloud, normals=NORMALS.astype(np.float32), extra={"inside": np.arange(7) > 3})
    written = plain_ply(path)
    before = cloud.source
    assert (written.text, written.byte_order) == (before.text, before.byte_order)
    assert written.comments == ("made by a scanner",)
    names = [p.name for p in written["vertex"].properties]
    assert names == ["x", "y", "z", "nx", "ny", "nz", "red", "quality", "inside"]
    np.testing.assert_array_equal(written["vertex"].data["ny"], NORMALS[:, 1].astype(np.float32))
    np.testing.assert_array_equal(written["vertex"].data["quality"], np.linspace(0, 1, 7))
    np.testing.assert_array_equal(written["vertex"].data["inside"], [0, 0, 0, 0, 1, 1, 1])
    for row, old in zip(written["face"].data, before["face"].data, strict=True):
        assert list(row["vertex_indices"]) == list(old["vertex_indices"])
    assert list(written["face"].data["flags"]) == [7, 8, 9]
    assert list(written["edge"].data["vertex2"]) == [6, 2]


@pytest.mark.parametrize("kind", PLY_KINDS)
def test_ply_replaces_normals_in_their_own_type(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "scan.ply"
    coloured_ply(path, kind, with_normals=True)
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.normals, np.zeros((7, 3)))
    write_cloud(path, cloud, normals=NORMALS)
    again = read_cloud(path)
    assert again.normals is not None
    assert again.normals.dtype == np.float32
    np.testing.assert_array_equal(again.normals, NORMALS.astype(np.float32))


@pytest.mark.parametrize("kind", PLY_KINDS)
@pytest.mark.parametrize("polygons", [False, True])
def test_ply_leaves_out_points_and_what_refers_to_them(tmp_path: Path, kind: str, polygons: bool) -> None:
    path = tmp_path / "scan.ply"
    coloured_ply(path, kind, faces=([3, 4, 5, 6], [0, 3, 4], [4, 5, 6]) if polygons else None)
    keep = np.arange(7) >= 2
    write_cloud(path, read_cloud(path), normals=NORMALS, keep=keep)
    written = plain_ply(path)
    np.testing.assert_array_equal(written["vertex"].data["red"], np.arange(2, 7) * 30)
    faces = [list(row) for row in written["face"].data["vertex_indices"]]
    assert faces == ([[1, 2, 3, 4], [2, 3, 4]] if polygons else [[0, 1, 2], [2, 3, 4]])
    assert len(written["edge"].data) == 0


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_every_format_gives_back_points_and_normals(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cloud{suffix}"
    write_cloud(path, CloudFile(POINTS, attributes={"label": np.arange(7)}), normals=NORMALS)
    cloud = read_cloud(path)
    # LAS keeps integers of a step of 2e-9 of the extent; it and PCD keep normals in single precision.
    tolerance = 1e-8 if suffix in (".las", ".laz") else 0.0
    np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=tolerance)
    assert cloud.normals is not None
    single = suffix in (".las", ".laz", ".pcd")
    np.testing.assert_allclose(cloud.normals, NORMALS, rtol=0, atol=6e-8 if single else 0.0)
    if suffix != ".obj":
        assert any(np.array_equal(values, np.arange(7)) for values in cloud.attributes.values())
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_every_format_writes_what_it_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cloud{suffix}"
    write_cloud(path, CloudFile(POINTS, attributes={"label": np.arange(7)}))
    keep = np.arange(7) != 3
    extra = {"strength": np.linspace(0, 2, 7)}
    write_cloud(path, read_cloud(path), normals=-NORMALS, extra=extra, keep=keep)
    cloud = read_cloud(path)
    np.testing.assert_allclose(cloud.points, POINTS[keep], rtol=0, atol=1e-8)
    assert cloud.normals is not None
    np.testing.assert_allclose(cloud.normals, -NORMALS[keep], rtol=0, atol=6e-8)
    if suffix != ".obj":
        for wanted in (np.arange(7)[keep], extra["strength"][keep]):
            assert any(np.array_equal(values, wanted) for values in cloud.attributes.values())


def test_formats_convert_into_each_other(tmp_path: Path) -> None:
    cloud = CloudFile(POINTS.astype(np.float32), attributes={"red": np.arange(7, dtype=np.uint8)})
    previous = tmp_path / "start.ply"
    write_cloud(previous, cloud, normals=NORMALS.astype(np.float32))
    for suffix in (".csv", ".npz", ".las", ".npy", ".ply"):
        following = tmp_path / f"next{suffix}"
        write_cloud(following, read_cloud(previous))
        previous = following
    final = read_cloud(previous)
    np.testing.assert_allclose(final.points, POINTS, atol=1e-6)
    np.testing.assert_allclose(final.normals, NORMALS, atol=1e-6)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("1 2 3\n4 5 6\n", []),
        ("# a comment\n1\t2\t3\t0.5\n4\t5\t6\t0.25\n", ["column_4"]),
        ("x,y,z,name\n1,2,3,wall\n4,5,6,roof\n", ["name"]),
        ("id;X;Y;Z\n900;1;2;3\n901;4;5;6\n", ["id"]),
        ("//X Y Z Intensity\n1 2 3 7\n4 5 6 8\n", ["Intensity"]),
        ("2\n1 2 3 7\n4 5 6 8\n", ["column_4"]),
        ("1 2 3 255 0 0\n4 5 6 0 255 0\n", ["red", "green", "blue"]),
        ("\n1,2,3\n\n4,5,6\n", []),
    ],
)
def test_text_of_any_layout(tmp_path: Path, content: str, expected: list[str]) -> None:
    path = tmp_path / "cloud.txt"
    path.write_text(content)
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6]])
    assert cloud.normals is None
    assert list(cloud.attributes) == expected
    write_cloud(path, cloud, normals=np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]]))
    again = read_cloud(path)
    np.testing.assert_array_equal(again.points, cloud.points)
    np.testing.assert_array_equal(again.normals, [[0, 0, 1], [0.6, 0, 0.8]])
    for (_, old), (_, new) in zip(cloud.attributes.items(), again.attributes.items(), strict=True):
        np.testing.assert_array_equal(old, new)


def test_text_keeps_its_look(tmp_path: Path) -> None:
    path = tmp_path / "cloud.csv"
    path.write_text("# scanned on a Monday\nid;X;Y;Z\n9007199254740993;1.5;2;3\n12;4;5;6\n")
    write_cloud(path, read_cloud(path), normals=np.eye(3)[:2])
    lines = path.read_text().splitlines()
    assert lines[:2] == ["# scanned on a Monday", "id;X;Y;Z;nx;ny;nz"]
    # An id beyond 2**53 does not survive as a float.
    assert lines[2].startswith("9007199254740993;1.5;2.0;3.0;1.0;0.0;0.0")


def test_unit_columns_are_normals_and_colours_are_not(tmp_path: Path) -> None:
    path = tmp_path / "cloud.xyz"
    path.write_text("0 0 0 0.6 0.8 0 200\n1 1 1 0 0 -1 100\n")
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.normals, [[0.6, 0.8, 0], [0, 0, -1]])
    assert list(cloud.attributes) == ["column_7"]


OBJ = """# a mesh
mtllib scene.mtl
o thing
v 0 0 0 0.1 0.2 0.3
v 1 0 0 0.1 0.2 0.3
v 0 1 0 0.1 0.2 0.3
v 0 0 1 0.1 0.2 0.3
vt 0.5 0.5
vn 0 0 1
usemtl red
f 1/1/1 2/1/1 3/1/1
f -1 -2 -3
l 1 4
"""


def test_obj_lines_survive(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(OBJ)
    cloud = read_cloud(path)
    assert cloud.normals is None  # one normal for four points belongs to the faces
    np.testing.assert_array_equal(cloud.attributes["green"], [0.2] * 4)
    write_cloud(path, cloud, normals=NORMALS[:4])
    lines = path.read_text().splitlines()
    assert [line for line in lines if not line.startswith(("vn", "f"))] == [
        line for line in OBJ.splitlines() if not line.startswith(("vn", "f"))
    ]
    assert "f 1/1/1 2/1/2 3/1/3" in lines
    assert "f 4//4 3//3 2//2" in lines
    np.testing.assert_array_equal(read_cloud(path).normals, NORMALS[:4])

    write_cloud(path, read_cloud(path), keep=np.array([False, True, True, True]))
    lines = path.read_text().splitlines()
    assert "f 3//3 2//2 1//1" in lines
    assert not any(line.startswith("l ") for line in lines)
    assert sum(line.startswith("f") for line in lines) == 1


def test_npy_records_and_npz_neighbours(tmp_path: Path) -> None:
    records = np.zeros(5, dtype=[("t", "i8"), ("x", "f4"), ("y", "f4"), ("z", "f4")])
    records["x"] = np.arange(5)
    np.save(tmp_path / "a.npy", records)
    write_cloud(tmp_path / "a.npy", read_cloud(tmp_path / "a.npy"), normals=np.ones((5, 3), np.float32))
    again = np.load(tmp_path / "a.npy")
    assert again.dtype.names == ("x", "y", "z", "nx", "ny", "nz", "t")
    assert again["t"].dtype == np.int64

    np.savez(tmp_path / "b.npz", xyz=POINTS, label=np.arange(7), camera=np.eye(4))
    write_cloud(tmp_path / "b.npz", read_cloud(tmp_path / "b.npz"), normals=NORMALS, keep=np.arange(7) < 2)
    with np.load(tmp_path / "b.npz") as again:
        assert again["xyz"].shape == again["normals"].shape == (2, 3)
        assert again["label"].tolist() == [0, 1]
        np.testing.assert_array_equal(again["camera"], np.eye(4))


def test_las_keeps_its_integers_and_dimensions(tmp_path: Path) -> None:
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets, header.scales = [5e5, 4e6, 0], [0.001] * 3
    las = laspy.LasData(header)
    las.xyz = np.array([5e5, 4e6, 100]) + POINTS
    las.classification = np.arange(7)
    las.gps_time = np.linspace(1e9, 1e9 + 1, 7)
    las.write(tmp_path / "a.las")
    # Scanners sign in letters that LAS does not allow.
    content = (tmp_path / "a.las").read_bytes()
    (tmp_path / "a.las").write_bytes(content[:58] + b"Ger\xe4t".ljust(32, b"\0") + content[90:])
    cloud = read_cloud(tmp_path / "a.las")
    write_cloud(tmp_path / "b.laz", cloud, normals=NORMALS, extra={"strength": np.arange(7.0)})
    again = laspy.read(tmp_path / "b.laz")
    assert again.header.generating_software == b"Ger\xe4t"
    np.testing.assert_array_equal(again.X, las.X)
    np.testing.assert_array_equal(again.classification, np.arange(7))
    np.testing.assert_array_equal(again.gps_time, las.gps_time)
    np.testing.assert_allclose(again["NormalY"], NORMALS[:, 1], atol=6e-8)
    np.testing.assert_array_equal(again["strength"], np.arange(7.0))


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_meshes_as_others_read_them(tmp_path: Path, suffix: str) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = np.asarray(ball.vertices) + 3.0
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, vertices, np.asarray(ball.faces), normals=np.asarray(ball.vertices))
    read = trimesh.load_mesh(path)
    assert read.is_watertight
    assert read.is_winding_consistent
    assert read.volume == pytest.approx(ball.volume, rel=1e-5)  # STL is single precision
    if suffix == ".ply":
        ours = read_cloud(path)
        assert ours.points.dtype == np.float64
        np.testing.assert_array_equal(ours.points, vertices)
        np.testing.assert_array_equal(ours.normals, np.asarray(ball.vertices))
