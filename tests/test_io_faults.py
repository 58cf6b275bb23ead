"""Damaged files: every claim is held against the file, nothing crashes, and messages name the file."""

from __future__ import annotations

import errno
import os
import struct
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import io_files as made
import laspy
import numpy as np
import pytest

from face_plugin.io import CLOUD_SUFFIXES, CloudFile, read_cloud, write_cloud
from face_plugin.io.lascheck import check_las

BILLION = b"1000000000"


def las(path: Path, *, compress: bool = False) -> bytearray:
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [5e5, 6e5, 0]
    data = laspy.LasData(header)
    data.xyz = made.POINTS
    data.write(path, do_compress=compress)
    return bytearray(path.read_bytes())


def put(content: bytearray, at: int, form: str, value: int) -> bytes:
    struct.pack_into(form, content, at, value)
    return bytes(content)


def npy_header(shape: str) -> bytes:
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + bytes(240)


CLAIMS = {
    "vertices.ply": lambda: made.ply("binary_little_endian").replace(b"vertex 40", b"vertex " + BILLION) + made.LITTLE,
    "vertices_ascii.ply": lambda: made.BINARY["ascii.ply"]().replace(b"vertex 40", b"vertex " + BILLION),
    "beyond_int64.ply": lambda: made.BINARY["ascii.ply"]().replace(b"vertex 40", b"vertex 1" + b"0" * 30),
    "list_in_vertex.ply": lambda: (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nproperty float y\n"
        b"property float z\nproperty list uint double w\nend_header\n" + bytes(12) + b"\xff" * 4 + bytes(200)
    ),
    "binary.pcd": lambda: made.BINARY["binary.pcd"]().replace(b"POINTS 40", b"POINTS " + BILLION),
    "ascii.pcd": lambda: made.BINARY["ascii.pcd"]().replace(b"POINTS 40", b"POINTS " + BILLION),
    "compressed.pcd": lambda: made.pcd("binary_compressed", struct.pack("<II", 9, 2**31) + bytes(9)).replace(
        b"POINTS 40", b"POINTS 89478485"
    ),
    "field.pcd": lambda: made.BINARY["binary.pcd"]().replace(b"WIDTH", b"COUNT 1 1 99999999999\nWIDTH"),
    "rows.npy": lambda: npy_header("(1" + "0" * 30 + ", 3)"),
    "tera.npy": lambda: npy_header("(1000000000000, 3)"),
    "negative.npy": lambda: npy_header("(-5, 3)"),
    "tera.npz": lambda: made.npz(**{"points.npy": npy_header("(1000000000000, 3)")}),
    "vertices.off": lambda: f"OFF\n{10**12} 0 0\n" + made.lines(made.XYZ),
    "facets.stl": lambda: bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(500),
    "grid.ptx": lambda: made.ptx(3).replace("5\n9\n", "500000\n900000\n", 1),
}


@pytest.mark.parametrize("name", CLAIMS)
def test_claims_are_held_against_the_file(tmp_path: Path, name: str) -> None:
    content = CLAIMS[name]()
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    read = pytest.raises(ValueError, match="not a readable")
    tracemalloc.start()
    try:
        with read as caught:
            read_cloud(tmp_path / name)
        assert tracemalloc.get_traced_memory()[1] < 30e6
    finally:
        tracemalloc.stop()
    assert str(tmp_path / name) in str(caught.value)


LAS_CLAIMS = {
    "points": (247, "<Q", 10**9),
    "vlrs": (100, "<I", 10**9),
    "evlrs": (243, "<I", 10**9),
    "start": (96, "<I", 2**31),
    "header": (94, "<H", 60000),
    "record": (105, "<H", 0),
}


@pytest.mark.parametrize("name", LAS_CLAIMS)
def test_claims_of_las_headers(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.las"
    path.write_bytes(put(las(path), *LAS_CLAIMS[name]))
    start = time.perf_counter()
    with pytest.raises(ValueError, match=r"a\.las: not a readable LAS file"):
        read_cloud(path)
    assert time.perf_counter() - start < 5


def test_points_and_chunks_of_laz(tmp_path: Path) -> None:
    path = tmp_path / "a.laz"
    content = las(path, compress=True)
    check_las(path)
    start = struct.unpack_from("<I", content, 96)[0]
    table = struct.unpack_from("<q", content, start)[0]
    for at, form, value in ((247, "<Q", 10**12), (table + 4, "<I", 2_181_233_920), (start, "<q", 2**40)):
        path.write_bytes(put(bytearray(content), at, form, value))
        with pytest.raises(ValueError, match=r"a\.laz: not a readable LAZ file"):
            read_cloud(path)


def test_damaged_laz_does_not_end_the_process(tmp_path: Path) -> None:
    path = tmp_path / "a.laz"
    content = las(path, compress=True)
    table = struct.unpack_from("<q", content, struct.unpack_from("<I", content, 96)[0])[0]
    # The length of the first chunk, as the decoder reads it.
    content[table + 8 : table + 12] = b"\xff\xff\xff\x7f"
    path.write_bytes(content)
    code = (
        "import sys; from face_plugin.io import read_cloud\n"
        "try: read_cloud(sys.argv[1])\nexcept ValueError as error: print(error)"
    )
    child = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, timeout=60)
    assert child.returncode == 0
    assert "not a readable LAZ file" in child.stdout


def test_rows_of_too_many_words_are_not_read_as_others(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(made.ply("ascii") + made.lines([row + " 7" for row in made.XYZ]).encode())
    with pytest.raises(ValueError, match=r"row 1 is malformed"):
        read_cloud(tmp_path / "a.ply")


def test_faces_that_name_absent_vertices(tmp_path: Path) -> None:
    vertices = made.lines(["v " + row for row in made.XYZ])
    for last, found in (
        ("f 1 2 41", "line 41 names vertex 41 of 40"),
        ("f 0 1 2", "vertex 0"),
        ("f -1 -2 -41", "vertex -41"),
        ("l 1 99", "vertex 99"),
        ("f 1/1 2/2 x/3", "'x/3' is no vertex"),
    ):
        (tmp_path / "a.obj").write_text(vertices + last + "\n")
        with pytest.raises(ValueError, match=rf"a\.obj: .*{found}"):
            read_cloud(tmp_path / "a.obj")
    edges = "element edge 1\nproperty int vertex1\nproperty int vertex2\n"
    for more, row, found in (
        (made.FACES.replace("2", "1", 1), "3 0 1 40 9", "row 1 of 'face' names vertex 40 of 40"),
        (made.FACES.replace("2", "2", 1), "3 0 1 2 9\n4 0 1 2 -7 9", "row 2 of 'face' names vertex -7"),
        (edges, "3 40", "'edge' names vertex 40"),
    ):
        (tmp_path / "a.ply").write_bytes(made.ply("ascii", more=more) + made.lines(made.XYZ, row).encode())
        with pytest.raises(ValueError, match=rf"a\.ply: .*{found}"):
            read_cloud(tmp_path / "a.ply")
        assert len(read_cloud(tmp_path / "a.ply", strict=False)) == made.COUNT


@pytest.mark.parametrize("field", [("z", "U3"), ("z", "c16"), ("z", "f4", (2,)), ("z", "M8[s]"), ("w", "f4")])
def test_records_that_are_no_coordinates(tmp_path: Path, field: tuple[str, ...]) -> None:
    np.save(tmp_path / "a.npy", np.zeros(5, dtype=[("x", "f4"), ("y", "f4"), field]))
    with pytest.raises(ValueError, match=r"a\.npy: .*expected numbers x, y, z"):
        read_cloud(tmp_path / "a.npy")


def test_members_that_are_no_arrays_are_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    names = np.array(["", ""])
    np.savez(tmp_path / "a.npz", points=made.POINTS, names=names, meta=np.array({"a": 1}, dtype=object))
    cloud = read_cloud(tmp_path / "a.npz")
    np.testing.assert_array_equal(cloud.points, made.POINTS)
    assert "'meta.npy' holds Python objects" in caplog.text


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot limit the size of files")
@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_full_disk_names_the_path(tmp_path: Path, suffix: str) -> None:
    import resource

    path = tmp_path / f"a{suffix}"
    write_cloud(path, CloudFile(made.POINTS))
    before = path.read_bytes()
    many = np.random.default_rng(0).normal(size=(50_000, 3))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            write_cloud(path, CloudFile(many))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert caught.value.errno == errno.EFBIG
    assert str(path) in str(caught.value)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot limit the size of files")
def test_what_the_compressor_of_laz_cannot_write_is_a_full_disk(tmp_path: Path) -> None:
    """Wherever in its work the disk fills up; the compressor says no more than that it failed."""
    import resource

    many = np.random.default_rng(0).normal(size=(2500, 3))
    write_cloud(tmp_path / "whole.laz", CloudFile(many))
    size = (tmp_path / "whole.laz").stat().st_size
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    for limit in range(400, size, 1024):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limits[1]))
        try:
            with pytest.raises(OSError, match=r"a\.laz") as caught:
                write_cloud(tmp_path / "a.laz", CloudFile(many))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert caught.value.errno == errno.EFBIG
    assert os.listdir(tmp_path) == ["whole.laz"]


def test_missing_folder_names_the_path(tmp_path: Path) -> None:
    path = tmp_path / "none" / "a.ply"
    with pytest.raises(FileNotFoundError) as caught:
        write_cloud(path, CloudFile(made.POINTS))
    assert str(path) in str(caught.value)
    assert f".{path.stem}." not in str(caught.value)
