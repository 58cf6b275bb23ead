"""Writers of triangle meshes: PLY (binary), OBJ, STL (binary), OFF."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from face_plugin.io.cloudfile import Array, format_column, interleave
from face_plugin.io.plydata import PlyData
from face_plugin.io.plywrite import element, write_data
from face_plugin.io.stl import STL_FACET

__all__ = ["WRITERS"]


def _ply(path: Path, vertices: Array, faces: Array, normals: Array | None, more: Mapping[str, Array]) -> None:
    columns = {"x": vertices[:, 0], "y": vertices[:, 1], "z": vertices[:, 2]}
    if normals is not None:
        columns.update({"nx": normals[:, 0], "ny": normals[:, 1], "nz": normals[:, 2]})
    parts = [element("vertex", {**columns, **more}), element("face", {"vertex_indices": faces.astype("i4")})]
    write_data(path, PlyData(parts))


def _rows(values: Array, prefix: str = "") -> str:
    return interleave([format_column(values[:, k]) for k in range(values.shape[1])], " ", prefix)


def _obj(path: Path, vertices: Array, faces: Array, normals: Array | None, more: Mapping[str, Array]) -> None:
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        stream.write(_rows(vertices, "v "))
        indices = [format_column(faces[:, k] + 1) for k in range(3)]
        if normals is not None:
            stream.write(_rows(normals, "vn "))
            indices = [[f"{i}//{i}" for i in column] for column in indices]
        stream.write(interleave(indices, " ", "f "))


def _stl(path: Path, vertices: Array, faces: Array, normals: Array | None, more: Mapping[str, Array]) -> None:
    corners = vertices[faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1, keepdims=True)
    facets = np.zeros(len(faces), dtype=STL_FACET)
    facets["normal"] = np.divide(cross, length, out=np.zeros_like(cross), where=length > 0)
    facets["corners"] = corners
    with open(path, "wb") as stream:
        # A header that began with "solid" would be taken for an ascii file.
        stream.write(b"binary STL by face-plugin".ljust(80) + np.array([len(faces)], "<u4").tobytes())
        stream.write(facets.tobytes())


def _off(path: Path, vertices: Array, faces: Array, normals: Array | None, more: Mapping[str, Array]) -> None:
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        stream.write(f"OFF\n{len(vertices)} {len(faces)} 0\n" + _rows(vertices) + _rows(faces, "3 "))


WRITERS: dict[str, Callable[[Path, Array, Array, Array | None, Mapping[str, Array]], None]] = {
    ".ply": _ply,
    ".obj": _obj,
    ".stl": _stl,
    ".off": _off,
}
