"""Broken files are named with what was found, and a write that fails leaves the old file."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import numpy as np
import pytest

from face_plugin.io import MESH_SUFFIXES, CloudFile, check_output, read_cloud, write_cloud, write_mesh

POINTS = np.random.default_rng(0).normal(size=(7, 3))


def ply(header: str, body: bytes = b"") -> bytes:
    return ("ply\n" + header + "end_header\n").encode() + body


XYZ = "property float x\nproperty float y\nproperty float z\n"
BROKEN = {
    "empty.ply": (b"", "not a readable PLY"),
    "noise.ply": (bytes(range(256)), "not a readable PLY"),
    "cut.ply": (ply("format binary_little_endian 1.0\nelement vertex 9\n" + XYZ, b"\0" * 50), "end-of-file"),
    "words.ply": (ply("format ascii 1.0\nelement vertex 1\n" + XYZ, b"1 two 3\n"), "malformed"),
    "faces.ply": (
        ply("format ascii 1.0\nelement face 0\nproperty list uchar int vertex_indices\n"),
        "vertex",
    ),
    "flat.ply": (ply("format ascii 1.0\nelement vertex 1\nproperty float x\n", b"1\n"), "no x, y, z"),
    "huge.ply": (ply("format binary_little_endian 1.0\nelement vertex 99999999999\n" + XYZ), "end-of-file"),
    "empty.xyz": (b"", "no line with coordinates"),
    "two.xyz": (b"1 2\n3 4\n", "line 1 has 2 columns"),
    "ragged.xyz": (b"1 2 3\n4 5\n", "line 2 has 2 columns"),
    "word.xyz": (b"1 2 3\n4 five 6\n", "line 2: 'five' is not a number"),
    "names.csv": (b"a,b,c\n1,2,3\n", "no numbers under x, y, z"),
    "binary.txt": (bytes(range(256)), "not text"),
    "empty.obj": (b"# nothing\n", "no line 'v x y z'"),
    "short.obj": (b"v 1 2 3\nv 1 2\n", "line 2"),
    "noise.npy": (b"nonsense", "not a readable NPY"),
    "noise.npz": (b"PK\x03\x04 nonsense", "not a readable NPZ"),
    "noise.las": (b"LASF nonsense", "not a readable LAS"),
    "noise.laz": (b"nonsense" * 99, "not a readable LAZ"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_named_with_what_was_found(tmp_path: Path, name: str) -> None:
    content, message = BROKEN[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message) as caught:
        read_cloud(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)


@pytest.mark.parametrize("array", [np.zeros(3), np.zeros((3, 1)), np.zeros((2, 3, 3)), np.array([["a"] * 3])])
def test_arrays_of_another_shape_are_refused(tmp_path: Path, array: np.ndarray) -> None:
    np.save(tmp_path / "a.npy", array)
    np.savez(tmp_path / "a.npz", points=array)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(ValueError, match=name):
            read_cloud(tmp_path / name)


def test_pickled_arrays_are_not_loaded(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match=r"a\.npy"):
        read_cloud(tmp_path / "a.npy")


def test_unknown_extensions_list_the_allowed_ones(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"'\.dxf'; allowed are \.ply"):
        read_cloud(tmp_path / "a.dxf")
    with pytest.raises(ValueError, match=r"no extension; allowed are \.ply, \.obj, \.stl, \.off"):
        write_mesh(tmp_path / "a", np.eye(3), np.array([[0, 1, 2]]))


def test_outputs_are_checked_before_the_work(tmp_path: Path) -> None:
    assert check_output(tmp_path / "a.PLY", MESH_SUFFIXES) == tmp_path / "a.PLY"
    with pytest.raises(FileNotFoundError, match="no folder"):
        check_output(tmp_path / "none" / "a.ply", MESH_SUFFIXES)
    (tmp_path / "b.ply").mkdir()
    with pytest.raises(ValueError, match="is a folder"):
        check_output(tmp_path / "b.ply", MESH_SUFFIXES)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"normals": np.zeros((6, 3))}, "normals: shape"),
        ({"keep": np.ones(6, bool)}, "keep: 6 values for 7 points"),
        ({"extra": {"label": np.zeros(8)}}, "label: 8 values for 7 points"),
    ],
)
def test_arrays_of_another_length_are_refused(tmp_path: Path, arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        write_cloud(tmp_path / "a.ply", CloudFile(POINTS), **arguments)


@pytest.mark.parametrize(
    "faces", [np.array([[0, 1, 7]]), np.array([[-1, 0, 1]]), np.array([[0, 1]]), np.array([0, 1, 2])]
)
def test_faces_that_do_not_fit_are_refused(tmp_path: Path, faces: np.ndarray) -> None:
    with pytest.raises(ValueError, match="faces"):
        write_mesh(tmp_path / "a.ply", POINTS, faces)


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_a_failed_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
) -> None:
    from face_plugin.io import plywrite

    path = tmp_path / "a.ply"
    write_cloud(path, CloudFile(POINTS))
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise error

    # The header is on the disk by then.
    monkeypatch.setattr(plywrite, "binary_rows", fail)
    with pytest.raises(error):
        write_cloud(path, CloudFile(POINTS * 2))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.ply"]


def test_a_link_stays_a_link_and_rights_stay(tmp_path: Path) -> None:
    target, link = tmp_path / "target.ply", tmp_path / "link.ply"
    write_cloud(target, CloudFile(POINTS))
    target.chmod(0o640)
    link.symlink_to(target)
    write_cloud(link, CloudFile(POINTS * 2))
    assert link.is_symlink()
    np.testing.assert_array_equal(read_cloud(target).points, POINTS * 2)
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
