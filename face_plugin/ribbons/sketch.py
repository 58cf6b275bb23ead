"""`Sketch`: ribbons as triangles that know their stroke; checks on the way in."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from face_plugin.io import CloudFile

log = logging.getLogger(__name__)

Polygons = Sequence[tuple[NDArray[np.int64], NDArray[np.int64]]]
"""Polygons by number of corners: their rows in the file (k,), and their corners (k, c)."""


@dataclass(frozen=True)
class Sketch:
    """Ribbons as triangles.

    Attributes
    ----------
    vertices
        (m, 3) float64, in the unit and order of the file.
    faces
        (f, 3) int64, none of them degenerate.
    strokes
        (f,) int64: the stroke of each face, 0 to `stroke_count` - 1 in order of first appearance.
    normals
        (m, 3) float64 brush normals, of arbitrary side; None where the file has none.
    stations
        (m,) int64: the station of a vertex where they come in threes (centre and two borders); else None.
    problems
        What was wrong in the file and left out, a sentence each.
    source
        The file that the vertices are those of, for writing normals back into it; else None.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    strokes: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    stations: NDArray[np.int64] | None = None
    problems: tuple[str, ...] = ()
    source: CloudFile | None = None

    @property
    def stroke_count(self) -> int:
        """Number of strokes."""
        return int(self.strokes.max()) + 1

    @property
    def vertex_strokes(self) -> NDArray[np.int64]:
        """(m,) the stroke of each vertex, -1 for a vertex of no face."""
        owner = np.full(len(self.vertices), -1, dtype=np.int64)
        owner[self.faces] = self.strokes[:, None]
        return owner

    @property
    def areas(self) -> NDArray[np.float64]:
        """(f,) areas of the faces, in the square of the file's unit."""
        return face_areas(self.vertices, self.faces)

    def select(self, strokes: NDArray[np.integer] | NDArray[np.bool_]) -> Sketch:
        """Return a sketch of some of the strokes (indices, or a mask), with their vertices only.

        Raises
        ------
        ValueError
            None is selected.

        Examples
        --------
        >>> import numpy as np
        >>> from face_plugin.ribbons import teapot_sketch
        >>> teapot = teapot_sketch()
        >>> teapot.select(np.arange(3)).stroke_count
        3
        """
        chosen = np.zeros(self.stroke_count, dtype=np.bool_)
        chosen[strokes] = True
        if not chosen.any():
            raise ValueError(f"strokes: none selected, allowed are one or more of {self.stroke_count}")
        rows = chosen[self.strokes]
        used, corners = np.unique(self.faces[rows], return_inverse=True)
        stations = None
        if self.stations is not None:
            stations = np.unique(self.stations[used], return_inverse=True)[1]
        return Sketch(
            vertices=self.vertices[used],
            faces=corners.reshape(-1, 3),
            strokes=(np.cumsum(chosen) - 1)[self.strokes[rows]],
            normals=None if self.normals is None else self.normals[used],
            stations=stations,
        )


def face_areas(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Areas (f,) of triangles."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas: NDArray[np.float64] = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return areas


def assemble(
    vertices: NDArray[np.float64],
    polygons: Polygons,
    *,
    ids: NDArray[np.int64] | None = None,
    normals: NDArray[np.float64] | None = None,
    problems: Sequence[str] = (),
    source: CloudFile | None = None,
) -> Sketch:
    """Check polygons and make a sketch of them; what is wrong with some is reported, not fatal.

    Parameters
    ----------
    vertices
        (m, 3).
    polygons
        Strips, as read.
    ids
        The file's stroke of each of its polygons, by row; None recovers strokes as connected components.
    normals, problems, source
        As in `Sketch`; what is found here is added to the problems.

    Raises
    ------
    ValueError
        No face is left.
    """
    found = list(problems)
    triangles, rows = _triangulate(polygons, len(vertices), found)
    whole = np.isfinite(vertices[triangles]).reshape(-1, 9).all(axis=1)
    _note(found, int((~whole).sum()), "faces with a vertex that is not finite")
    triangles, rows = triangles[whole], rows[whole]
    # Before the degenerate go: a station of zero length must not cut its stroke in two.
    strokes = ids[rows] if ids is not None else _components(vertices, triangles)
    spread = np.ptp(vertices[triangles], axis=1).max(axis=1, initial=0.0)
    solid = face_areas(vertices, triangles) > 1e-9 * spread**2
    _note(found, int((~solid).sum()), "triangles of no area (stations of zero length or width)")
    triangles, strokes = triangles[solid], strokes[solid]
    if not len(triangles):
        raise ValueError(f"the sketch has no ribbon left: {'; '.join(found) or 'no faces'}")
    used = np.zeros(len(vertices), dtype=bool)
    used[triangles] = True
    stations = _triples(triangles, len(vertices))
    _unreferenced(found, used, stations)
    for problem in found:
        log.warning("ribbons: %s", problem)
    usable = None if normals is None or not np.isfinite(normals[used]).all() else normals.astype(np.float64)
    return Sketch(vertices, triangles, _by_appearance(strokes), usable, stations, tuple(found), source)


def _note(problems: list[str], count: int, what: str) -> None:
    if count:
        problems.append(f"left out {count} {what}")


def _triangulate(polygons: Polygons, count: int, problems: list[str]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Fans of the polygons (f, 3), in the order of the file, and the polygon's row of each triangle."""
    parts, owners, astray, short = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)], 0, 0
    for rows, corners in polygons:
        if corners.shape[1] < 3:
            short += len(corners)
            continue
        valid = ((corners >= 0) & (corners < count)).all(axis=1)
        astray += int((~valid).sum())
        for k in range(1, corners.shape[1] - 1):
            parts.append(corners[valid][:, [0, k, k + 1]])
            owners.append(rows[valid])
    _note(problems, astray, f"faces with an index outside of the {count} vertices")
    _note(problems, short, "faces of fewer than three corners")
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(parts)[order], owner[order]


def _triples(triangles: NDArray[np.int64], count: int) -> NDArray[np.int64] | None:
    """Station of each vertex if the vertices are threes and all faces lie between one three and another."""
    if count % 3:
        return None
    station: NDArray[np.int64] = np.arange(count, dtype=np.int64) // 3
    at = np.sort(station[triangles], axis=1)
    between = (at[:, 0] != at[:, 2]) & ((at[:, 1] == at[:, 0]) | (at[:, 1] == at[:, 2]))
    return station if between.all() else None


def _unreferenced(problems: list[str], used: NDArray[np.bool_], stations: NDArray[np.int64] | None) -> None:
    if stations is None:
        _note(problems, int((~used).sum()), "vertices that no face refers to")
        return
    alone = ~used.reshape(-1, 3).any(axis=1)
    _note(problems, int(alone.sum()), "strokes of a single station, or stations that no face refers to")
    _note(problems, int((~used).sum() - 3 * alone.sum()), "vertices that no face refers to")


def _components(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Label the connected components of triangles, through shared vertices."""
    corners = triangles
    if len(np.unique(triangles)) == triangles.size:
        # A soup in which no two triangles share a vertex: those at one place are one.
        corners = np.unique(vertices, axis=0, return_inverse=True)[1].reshape(-1)[triangles]
    start, end = corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel()
    shape = (len(vertices), len(vertices))
    graph = coo_array((np.ones(len(start), dtype=np.int8), (start, end)), shape=shape)
    label: NDArray[np.int64] = connected_components(graph, directed=False)[1].astype(np.int64)
    return label[corners[:, 0]]


def _by_appearance(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse]


def sparsify(sketch: Sketch, keep: float | Literal["alternate"] = "alternate") -> Sketch:
    """Remove strokes evenly, as the paper does to test gaps: every other one around a component.

    Strokes that follow one another in the file and touch are one component (the rings of a body, the strokes
    along a leg); of each component a stroke in every 1 / `keep` stays, its first included.

    Parameters
    ----------
    sketch
        Strokes in the order in which they were drawn.
    keep
        Fraction of the strokes to keep, in (0, 1]; "alternate" is 0.5.

    Returns
    -------
    Sketch

    Raises
    ------
    ValueError
        `keep` is outside its range.

    Examples
    --------
    >>> from face_plugin.ribbons import teapot_sketch
    >>> teapot = teapot_sketch()
    >>> 0.4 < sparsify(teapot).stroke_count / teapot.stroke_count < 0.65
    True
    """
    fraction = 0.5 if keep == "alternate" else keep
    if isinstance(fraction, str) or not 0 < fraction <= 1:
        raise ValueError(f'keep: found {keep!r}, allowed is "alternate" or a number in (0, 1]')
    count = sketch.stroke_count
    centres = sketch.vertices[sketch.faces].mean(axis=1)
    trees = [cKDTree(centres[sketch.strokes == k]) for k in range(count)]
    place = np.zeros(count, dtype=np.int64)
    for k in range(1, count):
        own = sketch.vertices[sketch.faces[sketch.strokes == k]]
        # The longest edge of a face covers the width of its ribbon, or half of it with a centre line.
        reach = 2.0 * float(np.linalg.norm(own - np.roll(own, 1, axis=1), axis=2).max())
        gap = trees[k - 1].query(trees[k].data, k=1)[0].min()
        place[k] = place[k - 1] + 1 if gap < reach else 0
    return sketch.select(np.floor(place * fraction) > np.floor((place - 1) * fraction))
