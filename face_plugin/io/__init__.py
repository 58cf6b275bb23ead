"""Point clouds and meshes on disk: what can be read is in `READ_SUFFIXES`, what is written in the other two.

Every file is written under another name in the same folder and then renamed: what stands under the wanted
name is always whole.
"""

from __future__ import annotations

import importlib
import logging
import os
from collections.abc import Mapping
from pathlib import Path
from typing import cast

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, replacing

__all__ = [
    "CLOUD_SUFFIXES",
    "MESH_SUFFIXES",
    "PLANE_SUFFIXES",
    "READ_SUFFIXES",
    "CloudFile",
    "check_output",
    "read_cloud",
    "write_cloud",
    "write_mesh",
]

_TEXT = (".xyz", ".xyzn", ".xyzrgb", ".txt", ".csv", ".asc", ".pts")
_MODULES = {
    ".ply": "ply",
    ".pcd": "pcd",
    ".obj": "obj",
    **dict.fromkeys(_TEXT, "text"),
    ".npy": "arrays",
    ".npz": "arrays",
    ".las": "las",
    ".laz": "las",
}
_READERS = {**_MODULES, ".e57": "e57", ".ptx": "ptx", ".off": "off", ".stl": "stl"}
READ_SUFFIXES = tuple(_READERS)
"""Extensions of the files that can be read."""
CLOUD_SUFFIXES = tuple(_MODULES)
"""Extensions of the clouds that can be written."""
MESH_SUFFIXES = (".ply", ".obj", ".stl", ".off")
"""Extensions of the meshes that can be written."""
PLANE_SUFFIXES = (".txt", ".csv", ".asc", ".npy", ".npz")
"""Extensions of the files that hold points in the plane: two columns, or columns x and y and no other coordinate."""
log = logging.getLogger(__name__)


def _suffix(path: Path, allowed: tuple[str, ...]) -> str:
    suffix = path.suffix.lower()
    if suffix not in allowed:
        found = f"extension {path.suffix!r}" if path.suffix else "no extension"
        raise ValueError(f"{path}: {found}; allowed are {', '.join(allowed)}")
    return suffix


def check_output(path: str | os.PathLike[str], allowed: tuple[str, ...]) -> Path:
    """Raise now what writing to `path` would raise at the end of a long computation.

    Parameters
    ----------
    path : path
        Where a file is to be written.
    allowed : tuple of str
        Extensions, such as `MESH_SUFFIXES`.

    Raises
    ------
    ValueError
        The extension is not allowed, or the path is a folder.
    FileNotFoundError, PermissionError
        The folder does not exist, or cannot be written to.

    Examples
    --------
    >>> check_output("mesh.ply", MESH_SUFFIXES).name
    'mesh.ply'
    """
    path = Path(path)
    _suffix(path, allowed)
    folder = Path(os.path.realpath(path)).parent
    if path.is_dir():
        raise ValueError(f"{path}: is a folder, not a file")
    if not folder.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {folder}")
    if not os.access(folder, os.W_OK):
        raise PermissionError(f"{path}: the folder {folder} cannot be written to")
    return path


def read_cloud(path: str | os.PathLike[str], *, strict: bool = True) -> CloudFile:
    """Read a point cloud; the extension tells the format.

    Parameters
    ----------
    path : path
        PLY (ascii or binary of either byte order), PCD, OBJ, XYZ/XYZN/XYZRGB/TXT/CSV/ASC/PTS (any delimiter,
        with or without column names, decimal points or commas), NPY, NPZ, LAS, LAZ and COPC (extra ``las``),
        E57 (extra ``e57``), PTX, OFF, or STL.
    strict : bool
        Refuse faces and lines that name a vertex which is not there, and log `CloudFile.problems` as warnings.
        False leaves both to the caller.

    Returns
    -------
    CloudFile
        Points (n, 3), or (n, 2) where the file has two coordinates (`PLANE_SUFFIXES`), in the file's own dtype,
        normals where it has them, and everything else it says.

    Raises
    ------
    ValueError
        Unknown extension, or a malformed file: the message names the file and what was found.
    OSError
        The file cannot be opened.
    MissingDependencyError
        LAS/LAZ without laspy, E57 without pye57.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> path = tempfile.mkdtemp() + "/cloud.npy"
    >>> np.save(path, np.eye(3))
    >>> len(read_cloud(path))
    3
    """
    path = Path(path)
    suffix = _suffix(path, READ_SUFFIXES)
    module = importlib.import_module(f"face_plugin.io.{_READERS[suffix]}")
    cloud = cast(CloudFile, module.read(path))
    if strict:
        if hasattr(module, "check"):
            module.check(path, cloud)
        for problem in cloud.problems:
            log.warning("%s: %s", path, problem)
    return cloud


def write_cloud(
    path: str | os.PathLike[str],
    cloud: CloudFile,
    *,
    normals: Array | None = None,
    extra: Mapping[str, Array] | None = None,
    keep: Array | None = None,
) -> None:
    """Write a cloud, with new normals, to a file of the same or another format.

    Within one format all that was read is kept: other properties and elements, comments, byte order,
    delimiter. Across formats points, normals and per-point attributes are carried over.

    Parameters
    ----------
    path : path
        One of `CLOUD_SUFFIXES`.
    cloud : CloudFile
        What was read, or ``CloudFile(points)``.
    normals : (n, d) array, optional
        Take the place of the normals of the cloud, or are added.
    extra : dict of str to (n,) array, optional
        Further values for each point; an attribute of the same name is replaced.
    keep : (n,) bool array, optional
        Points to write; faces and lines that use another point are left out.

    Raises
    ------
    ValueError
        Unknown extension, or an array of the wrong length.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> path = tempfile.mkdtemp() + "/cloud.ply"
    >>> write_cloud(path, CloudFile(np.eye(3)), normals=np.eye(3))
    >>> read_cloud(path).normals.tolist()[0]
    [1.0, 0.0, 0.0]
    """
    path = Path(path)
    suffix = _suffix(path, CLOUD_SUFFIXES)
    extra = dict(extra or {})
    if normals is not None and normals.shape != cloud.points.shape:
        raise ValueError(f"normals: shape {normals.shape}, expected {cloud.points.shape}")
    if cloud.points.shape[1] == 2 and suffix not in PLANE_SUFFIXES:
        raise ValueError(f"{path}: points in the plane go to {', '.join(PLANE_SUFFIXES)}, found {suffix}")
    for name, values in {**extra, "keep": np.empty(len(cloud)) if keep is None else keep}.items():
        if len(values) != len(cloud):
            raise ValueError(f"{name}: {len(values)} values for {len(cloud)} points")
    module = importlib.import_module(f"face_plugin.io.{_READERS[suffix]}")
    with replacing(path) as temporary:
        module.write(temporary, cloud, normals, extra, keep)


def write_mesh(
    path: str | os.PathLike[str],
    vertices: Array,
    faces: Array,
    *,
    normals: Array | None = None,
    attributes: Mapping[str, Array] | None = None,
) -> None:
    """Write a triangle mesh as binary PLY, OBJ, binary STL or OFF.

    Parameters
    ----------
    path : path
        Extension .ply, .obj, .stl or .off.
    vertices : (k, 3) array
        PLY keeps their dtype; STL can only hold float32.
    faces : (f, 3) integer array
        Indices of vertices, counter-clockwise seen from outside.
    normals : (k, 3) array, optional
        One a vertex; kept by PLY and OBJ.
    attributes : dict of str to (k,) array, optional
        Further values for each vertex; kept by PLY.

    Raises
    ------
    ValueError
        Unknown extension, wrong shapes, or indices out of range.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> path = tempfile.mkdtemp() + "/mesh.ply"
    >>> write_mesh(path, np.eye(3), np.array([[0, 1, 2]]))
    >>> len(read_cloud(path))
    3
    """
    path = Path(path)
    suffix = _suffix(path, MESH_SUFFIXES)
    vertices, faces = np.asarray(vertices), np.asarray(faces)
    for name, values in (("vertices", vertices), ("faces", faces)):
        if values.ndim != 2 or values.shape[1] != 3:
            raise ValueError(f"{name}: shape {values.shape}, expected (any, 3)")
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise ValueError(f"faces: indices {faces.min()} to {faces.max()} for {len(vertices)} vertices")
    from face_plugin.io import meshes

    with replacing(path) as temporary:
        meshes.WRITERS[suffix](temporary, vertices, faces, normals, dict(attributes or {}))
