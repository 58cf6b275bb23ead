"""Poisson surface reconstruction (PSR) through a host that is installed."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from face_plugin.cloud import as_points
from face_plugin.errors import FaceError, MissingDependencyError
from face_plugin.memory import GIGABYTE, available_memory
from face_plugin.poisson_hosts import by_open3d, by_pymeshlab
from face_plugin.threads import KDTree
from face_plugin.trimming import Arrays, TrimDistance, check_distance, trimmed, where_to_cut

__all__ = [
    "Backend",
    "check_arguments",
    "is_closed",
    "poisson_reconstruction",
    "reconstruction_memory",
    "suggested_depth",
]

log = logging.getLogger(__name__)

Backend = Literal["open3d", "pymeshlab"]
BACKENDS: tuple[Backend, ...] = ("open3d", "pymeshlab")
DEPTHS = (1, 16)
# Open3D's own least depth; PyMeshLab takes 1.
OPEN3D_LEAST = 2
FEWEST_POINTS = 4
# Triangles of a tetrahedron: fewer are no surface of anything.
FEWEST_FACES = 4
# Weight of the points in the screened variant: the value that Kazhdan and Hoppe recommend for linear
# elements, and the default of both hosts.
SCREENING = 4.0
# Side of the cube in which is reconstructed, in that of the points: the hosts' own, and larger ones where the surface
# leaves it and is cut open.
SCALES = (1.1, 1.25, 1.5, 2.0)

# Depths suggested: below, nothing is left of most shapes; above, faces number in the hundreds of millions.
SUGGESTED = (5, 12)
# Points whose spacing is looked at.
PROBES = 2_000
# Measured with Open3D and PyMeshLab on spheres of 20k and 200k points at depths 7 to 10 (docs/scaling.md):
# bytes for a finest cell with points in it, and the further share for each depth below the spacing.
CELL_BYTES = 1.5e3
DEEPER_SHARE = 0.6
_BITS = 20


def poisson_reconstruction(
    points: NDArray[np.floating],
    normals: NDArray[np.floating],
    *,
    depth: int | None = 8,
    screened: bool = True,
    backend: Backend | None = None,
    trim: float = 0.0,
    trim_distance: TrimDistance = "auto",
    open_at: NDArray[np.bool_] | None = None,
) -> Arrays:
    """Reconstruct a surface from oriented points (Kazhdan et al. 2006; screened: Kazhdan and Hoppe 2013).

    Parameters
    ----------
    points, normals : (n, 3) float
        Points in any unit, and outward unit normals.
    depth : int, 1 to 16 (Open3D: 2 to 16), or None
        Depth of the octree: the finest cell is 1.1 x the longest side / 2**depth (Open3D). None: from the
        spacing of the points, at most 12. A warning says when it will not fit into memory.
    screened : bool
    backend : {"open3d", "pymeshlab"}, optional
        By default whichever is installed, Open3D first.
    trim : float, fraction in [0, 1)
        Drop the vertices whose sampling density is in this lowest fraction (Open3D only). This opens the
        surface.
    trim_distance : float > 0, "auto" or None
        Cut the surface where it is more than so many spacings from the points, or cells of the octree where these are
        wider. "auto": 2 around the points of `open_at`, and no cut around others. None: no cut.
    open_at : (n,) bool, optional
        Which points are part of an open surface, as `Result.open` has it.

    Returns
    -------
    vertices : (k, 3) float64
    faces : (f, 3) int64
        Oriented outward.
    densities : (k,) float64 or None
        Sampling density at the vertices; None from PyMeshLab, which does not give it.

    Raises
    ------
    ValueError
        An argument is out of range.
    FaceError
        The surface is empty: at this depth, or of these points, the host makes none.
    MissingDependencyError
        No host is installed; with the line to install one.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> vertices, faces, _ = poisson_reconstruction(ball.points, ball.normals, depth=5)
    >>> vertices.shape[1], faces.shape[1]
    (3, 3)
    """
    backend = check_arguments(depth, backend, trim, trim_distance)
    points, normals = as_points(points), as_points(normals, "normals")
    if len(normals) != len(points):
        raise ValueError(f"normals must be as many as points, found {len(normals)} for {len(points)}")
    if len(points) < FEWEST_POINTS:
        raise ValueError(f"points must hold at least {FEWEST_POINTS} points to reconstruct from, found {len(points)}")
    # Hosts work partly in single precision: reconstruct near the origin and at unit size.
    origin = 0.5 * (points.min(axis=0) + points.max(axis=0)).astype(np.float64)
    size = float(np.ptp(points, axis=0).max())
    if size == 0.0:
        raise ValueError(f"points must be distinct, found {len(points)} points at one place")
    local = (points.astype(np.float64) - origin) / size
    if depth is None:
        depth = suggested_depth(local)
    warn_if_too_large(local, depth)
    run = by_open3d if backend == "open3d" else by_pymeshlab
    cut_at = where_to_cut(len(local), trim_distance, open_at)
    # What is cut all around need not be closed before.
    scales = SCALES[:1] if cut_at.all() else SCALES
    made = _closed(run, local, normals.astype(np.float64), int(depth), SCREENING * screened, scales)
    vertices, faces, densities = trimmed(made, local, trim, trim_distance, cut_at, SCALES[0] / 2**depth)
    if len(faces) < FEWEST_FACES:
        less = (f", less trim than {trim:g}" if trim > 0 else "") + (", a larger trim_distance" if cut_at.any() else "")
        found = f"{len(faces)} triangles from {len(points)} points"
        raise FaceError(
            f"the surface is empty: try a deeper octree than depth={depth}{less} or more points; found {found}"
        )
    return vertices * size + origin, faces, densities


def check_arguments(
    depth: int | None, backend: Backend | None, trim: float, trim_distance: TrimDistance = None
) -> Backend:
    """Check the arguments of `poisson_reconstruction`, which come late; return the backend that will run.

    Examples
    --------
    >>> check_arguments(8, "open3d", 0.1)
    'open3d'
    """
    whole = isinstance(depth, (int, np.integer)) and not isinstance(depth, bool)
    if depth is not None and (not whole or not DEPTHS[0] <= depth <= DEPTHS[1]):
        raise ValueError(f"depth must be an integer from {DEPTHS[0]} to {DEPTHS[1]}, found {depth!r}")
    if not isinstance(trim, (int, float, np.number)) or not 0.0 <= trim < 1.0:
        raise ValueError(f"trim must be in [0, 1), found {trim!r}")
    check_distance(trim_distance)
    if backend is None:
        backend = _installed()
    if backend not in BACKENDS:
        raise ValueError(f"backend must be one of {BACKENDS} or None, found {backend!r}")
    if backend == "open3d" and depth is not None and depth < OPEN3D_LEAST:
        raise ValueError(f"depth must be an integer from {OPEN3D_LEAST} to {DEPTHS[1]} with Open3D, found {depth!r}")
    if trim > 0 and backend != "open3d":
        raise ValueError(f"trim needs the backend 'open3d', which gives densities; found {backend!r}")
    return backend


def _installed() -> Backend:
    for name in BACKENDS:
        if importlib.util.find_spec(name) is not None:
            return name
    raise MissingDependencyError(
        "surface reconstruction needs Open3D or PyMeshLab: pip install 'face-plugin[open3d]' "
        "or pip install 'face-plugin[pymeshlab]'"
    )


def _closed(
    run: Callable[..., Arrays],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    depth: int,
    weight: float,
    scales: tuple[float, ...],
) -> Arrays:
    """Reconstruct in the smallest cube in which the surface is closed: over a wide gap it bulges beyond the points.

    That of a sheet is closed in none, and is then that of the first.
    """
    made = [run(points, normals, depth, weight, scales[0])]
    for scale in scales[1:]:
        if is_closed(made[-1][1]):
            return made[-1]
        made.append(run(points, normals, depth, weight, scale))
    return made[-1] if len(made) > 1 and is_closed(made[-1][1]) else made[0]


def is_closed(faces: NDArray[np.integer]) -> bool:
    """Tell whether faces run along every edge as often in one direction as in the other: no boundary."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    size = int(edges.max(initial=0)) + 1
    there, back = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    return len(faces) > 0 and np.array_equal(np.sort(there), np.sort(back))


def suggested_depth(points: NDArray[np.floating]) -> int:
    """Depth of the octree whose finest cell is as wide as the spacing of the points, from 5 to 12.

    Parameters
    ----------
    points : (n, 3) float, in any unit

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> suggested_depth(sphere(2000).points)
    5
    """
    depth = round(_resolved_depth(points))
    return min(max(depth, SUGGESTED[0]), SUGGESTED[1])


def _resolved_depth(points: NDArray[np.floating]) -> float:
    """Depth, as a real number, at which a cell is as wide as the median distance to the 6 nearest."""
    probes = points[:: max(1, len(points) // PROBES)]
    distance = KDTree(points).query(probes, k=min(7, len(points)))[0]
    spacing = float(np.median(distance[:, 1:].mean(axis=1)))
    longest = float(np.ptp(points, axis=0).max())
    return float(np.log2(SCALES[0] * longest / spacing)) if spacing > 0 else float(SUGGESTED[1])


def reconstruction_memory(points: NDArray[np.floating], depth: int) -> float:
    """Bytes that a reconstruction takes, within a factor of about 1.5.

    Parameters
    ----------
    points : (n, 3) float, in any unit
    depth : int
    """
    cell = SCALES[0] * float(np.ptp(points, axis=0).max()) / 2 ** min(depth, _BITS)
    index = ((points - points.min(axis=0)) / cell).astype(np.int64)
    occupied = len(np.unique((index[:, 0] << 2 * _BITS) | (index[:, 1] << _BITS) | index[:, 2]))
    return CELL_BYTES * occupied * (1.0 + DEEPER_SHARE * max(0.0, depth - _resolved_depth(points)))


def warn_if_too_large(points: NDArray[np.floating], depth: int) -> None:
    """Log a warning, with numbers, before a reconstruction that does not fit into the memory that is free."""
    needed, free = reconstruction_memory(points, depth), available_memory()
    if needed > free:
        log.warning(
            "a reconstruction of depth %d from %d points takes about %.3g GB, and %.3g GB are free: it may be killed; "
            "the points bear a depth of %d, and each less takes about a quarter",
            depth,
            len(points),
            needed / GIGABYTE,
            free / GIGABYTE,
            suggested_depth(points),
        )
