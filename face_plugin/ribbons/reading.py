"""Reading ribbon sketches from PLY and OBJ, and writing normals back to their vertices."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.io import CloudFile, check_output, read_cloud, write_cloud, write_mesh
from face_plugin.ribbons.objstrokes import polylines_to_strokes, vertex_indices
from face_plugin.ribbons.sketch import Polygons, Sketch, assemble
from face_plugin.ribbons.strokes import ribbons

__all__ = ["SKETCH_SUFFIXES", "read_sketch", "write_normals"]

SKETCH_SUFFIXES = (".ply", ".obj")
_IDS = ("stroke", "stroke_id", "strokeid", "stroke_index")
_CORNERS = ("vertex_indices", "vertex_index")


def read_sketch(path: str | os.PathLike[str], *, width: float | None = None) -> Sketch:
    """Read a sketch, tolerantly: what is wrong with some of it is left out, logged, and listed in `problems`.

    PLY: the layout of SurfaceBrush (a vertex at the stroke's centre and one at each border for every station,
    the three with the normal of the brush, quads between stations), or any strips of triangles or quads, as
    faces or ``tristrips``. Strokes are taken from an integer property ``stroke`` (also ``stroke_id``) of the
    faces or the vertices, else from connectivity. OBJ: faces, with strokes from ``o`` or ``g`` where there are
    several, else from connectivity; or centre lines (``v`` and ``l``), which are swept into ribbons (see
    `polylines_to_strokes`).

    Parameters
    ----------
    path
        .ply or .obj.
    width
        Full width of the ribbons swept from centre lines, in the file's unit; it goes before that of the
        file.

    Returns
    -------
    Sketch

    Raises
    ------
    ValueError
        Unknown extension, malformed file, no ribbon in it, or `width` is not positive.
    OSError
        The file cannot be opened.

    Examples
    --------
    >>> import tempfile, numpy as np
    >>> from face_plugin.io import write_mesh
    >>> path = tempfile.mkdtemp() + "/ribbon.obj"
    >>> write_mesh(path, np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    >>> read_sketch(path).stroke_count
    1
    """
    path = Path(path)
    if path.suffix.lower() not in SKETCH_SUFFIXES:
        raise ValueError(f"{path}: extension {path.suffix!r}; allowed are {', '.join(SKETCH_SUFFIXES)}")
    if width is not None and not (np.isfinite(width) and width > 0):
        raise ValueError(f"width: found {width}, allowed is a positive number")
    # Faces that name absent vertices are counted and left out here, and a file that breaks off is drawn as far
    # as it goes.
    cloud = read_cloud(path, strict=False)
    problems = list(cloud.problems)
    try:
        if path.suffix.lower() == ".ply":
            polygons, ids = _ply_polygons(cloud)
        else:
            polygons, ids = _obj_polygons(cloud)
            if not polygons:
                strokes = polylines_to_strokes(cloud.source, cloud.normals, width, problems)
                return ribbons(strokes, problems)
        vertices = cloud.points.astype(np.float64)
        return assemble(vertices, polygons, ids=ids, normals=cloud.normals, problems=problems, source=cloud)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _by_length(corners: list[NDArray[np.int64]]) -> Polygons:
    lengths = np.array([len(row) for row in corners], dtype=np.int64)
    rows = [np.flatnonzero(lengths == k) for k in np.unique(lengths)]
    return [(group, np.array([corners[k] for k in group], dtype=np.int64).reshape(len(group), -1)) for group in rows]


def _ply_polygons(cloud: CloudFile) -> tuple[Polygons, NDArray[np.int64] | None]:
    faces = next((e.data for e in cloud.source.elements if e.name == "face"), None)
    name = next((n for n in _CORNERS if faces is not None and n in faces.dtype.names), None)
    if faces is None or name is None or not len(faces):
        return _ply_strips(cloud)
    corners = faces[name]
    if corners.dtype.kind == "O":
        polygons = _by_length([np.asarray(row, dtype=np.int64) for row in corners])
    else:
        polygons = [(np.arange(len(corners)), corners.astype(np.int64))]
    for label in _IDS:
        if label in faces.dtype.names:
            return polygons, faces[label].astype(np.int64)
        if label in cloud.attributes:
            ids = np.zeros(len(corners), dtype=np.int64)
            for rows, group in polygons:
                # Of a face with indices astray any will do: it is left out.
                ids[rows] = cloud.attributes[label][np.clip(group[:, 0], 0, len(cloud) - 1)]
            return polygons, ids
    return polygons, None


def _ply_strips(cloud: CloudFile) -> tuple[Polygons, NDArray[np.int64] | None]:
    """Triangles of ``tristrips``: every vertex makes one with the two before it, and -1 begins another strip."""
    strips = next((e.data for e in cloud.source.elements if e.name == "tristrips"), None)
    name = next((n for n in _CORNERS if strips is not None and n in strips.dtype.names), None)
    if strips is None or name is None:
        return [], None
    triangles = [np.empty((0, 3), dtype=np.int64)]
    for row in strips[name]:
        corners = np.asarray(row, dtype=np.int64)
        for strip in np.split(corners, np.flatnonzero(corners == -1)):
            strip = strip[strip != -1]
            if len(strip) >= 3:
                three = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
                three[1::2] = three[1::2, [1, 0, 2]]
                triangles.append(three)
    # Two equal neighbours turn a strip round a corner; their triangles are none.
    found = np.concatenate(triangles)
    found = found[(found[:, 0] != found[:, 1]) & (found[:, 1] != found[:, 2]) & (found[:, 0] != found[:, 2])]
    return [(np.arange(len(found)), found)] if len(found) else [], None


def _obj_polygons(cloud: CloudFile) -> tuple[Polygons, NDArray[np.int64] | None]:
    corners: list[NDArray[np.int64]] = []
    ids: list[int] = []
    groups: dict[str, int] = {}
    group = seen = 0
    for line in cloud.source:
        words = line.split()
        keyword = words[0] if words else ""
        if keyword == "v":
            seen += 1
        elif keyword in ("o", "g"):
            group = groups.setdefault(line, len(groups) + 1)
        elif keyword == "f":
            corners.append(vertex_indices(words[1:], seen))
            ids.append(group)
    return _by_length(corners), np.array(ids) if len(set(ids)) > 1 else None


def write_normals(path: str | os.PathLike[str], sketch: Sketch, normals: NDArray[np.floating]) -> None:
    """Write the sketch with a normal at each of its vertices.

    Into a file of the format that it was read from, everything else in it is kept (quads, colours, order);
    other sketches are written as triangles, with the stroke of each vertex where the format has a place for
    it.

    Parameters
    ----------
    path
        .ply or .obj.
    sketch
        As read.
    normals
        (m, 3), see `normals_at_vertices`.

    Raises
    ------
    ValueError
        Unknown extension, or the shape of `normals` does not fit.

    Examples
    --------
    >>> import tempfile
    >>> from face_plugin.ribbons import teapot_sketch
    >>> teapot = teapot_sketch()
    >>> write_normals(tempfile.mkdtemp() + "/teapot.ply", teapot, teapot.normals)
    """
    path = check_output(path, SKETCH_SUFFIXES)
    if normals.shape != sketch.vertices.shape:
        raise ValueError(f"normals: found shape {normals.shape}, allowed is {sketch.vertices.shape}")
    if sketch.source is not None and sketch.source.suffix == path.suffix.lower():
        write_cloud(path, sketch.source, normals=normals)
        return
    attributes: dict[str, NDArray[Any]] = {"stroke": sketch.vertex_strokes}
    write_mesh(path, sketch.vertices, sketch.faces, normals=normals, attributes=attributes)
