"""The front desk: unoriented points in, outward normals and a surface out, in one piece or in tiles."""

from __future__ import annotations

import dataclasses
import os
import time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin import cloud
from face_plugin.execution import EngineLike, Execution
from face_plugin.params import Params, settled
from face_plugin.plane import refuse_in_plane
from face_plugin.result import Result, Surface, kept_points
from face_plugin.sculpt import SculptFile
from face_plugin.sides.given import checked_trust, given_lines
from face_plugin.sides.sensors import Sensors, sensors_of
from face_plugin.solver import FaCE
from face_plugin.stages import Progress
from face_plugin.surface import Backend, check_arguments, poisson_reconstruction
from face_plugin.tiles.plan import check_one_piece, in_tiles
from face_plugin.tiles.tiled import Tiled
from face_plugin.trimming import TrimDistance

__all__ = ["estimate_normals", "orient_normals", "reconstruct", "solve", "solve_whole"]


def solve(
    points: ArrayLike,
    params: Params | None = None,
    *,
    sensors: Sensors | None = None,
    classify: bool = False,
    execution: Execution | None = None,
    progress: Progress | None = None,
) -> FaCE | Tiled:
    """Solve a cloud of any size, in one piece or in tiles as `Execution.tile_points` and the memory say.

    Parameters
    ----------
    points, params, execution, progress
        As of `estimate_normals`.
    sensors : Sensors, optional
        Where sensors stood.
    classify : bool
        Whether it will be asked which points are interior: tiles then find it out in the same pass.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> type(solve(sphere(500).points)).__name__
    'FaCE'
    """
    array, (params, execution) = cloud.as_points(points, dimensions=cloud.SPACE_OR_PLANE), settled(params, execution)
    if array.shape[1] == 3 and in_tiles(len(array), execution):
        return Tiled(array, params, sensors=sensors, classify=classify, execution=execution, progress=progress)
    return FaCE(array, params, sensors=sensors, execution=execution, progress=progress)


def solve_whole(
    points: ArrayLike,
    params: Params | None = None,
    *,
    purpose: str,
    sensors: Sensors | None = None,
    execution: Execution | None = None,
    progress: Progress | None = None,
) -> FaCE:
    """Solve a cloud in one piece, whatever its size: for edits, and for the field at any position.

    Parameters
    ----------
    points, params, execution, progress
        As of `estimate_normals`.
    sensors : Sensors, optional
        Where sensors stood.
    purpose : str
        What needs it, for the message.

    Raises
    ------
    ValueError
        There is not the memory for it.
    """
    array, (params, execution) = cloud.as_points(points, dimensions=cloud.SPACE_OR_PLANE), settled(params, execution)
    if array.shape[1] == 3:
        check_one_piece(len(array), execution, purpose)
    return FaCE(array, params, sensors=sensors, execution=execution, progress=progress)


def estimate_normals(
    points: ArrayLike,
    params: Params | None = None,
    *,
    filter_interior: bool = False,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    up: ArrayLike | None = None,
    sculpt: SculptFile | str | os.PathLike[str] | None = None,
    execution: Execution | None = None,
    engine: EngineLike | None = None,
    progress: Progress | None = None,
) -> Result:
    """Outward normals of an unoriented point cloud by Faraday cage estimation.

    Large clouds are solved in tiles, as `Execution.tile_points` says; see `face_plugin.tiles`. Points in the plane are
    taken for curves and solved in one piece; there are no sensors and no edits.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit; or (n, 2) in the plane
        At least four distinct points that do not lie on one line. Duplicates are allowed.
    params : Params, optional
    filter_interior : bool
        Also classify the points as interior or not.
    viewpoints : (k, 3) array_like, optional
        Where sensors stood, in the unit of the points. Normals then point to the space that they saw: into a room that
        was scanned from inside, up from a terrain. Needs no knowledge of which point was seen from where.
    seen_from : (n,) array_like of int, optional
        Row of the viewpoint that saw each point, -1 where that is not known.
    up : (3,) array_like, optional
        Direction from which all was seen, from afar: of aerial scans.
    sculpt : SculptFile or path, optional
        Charges and cage points to apply. The cloud is then solved in one piece, whatever its size.
    execution : Execution, optional
        In tiles of which size, by whom, and with how much memory.
    engine : str, Engine or distributed.Client, optional
        Deprecated: `Execution.engine`.
    progress : callable, optional
        ``progress(stage, fraction)``.

    Returns
    -------
    Result

    Raises
    ------
    ValueError
        Bad input; the message names the argument, what was found and what is allowed.
    MeshingError
        The space between the box and the balls could not be meshed.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> normals = estimate_normals(ball.points).normals
    >>> bool(((normals * ball.normals).sum(axis=1) > 0).all())
    True
    """
    refuse_in_plane(points, viewpoints=viewpoints, seen_from=seen_from, up=up, sculpt=sculpt)
    sensors = sensors_of(viewpoints, seen_from, up)
    params, execution = settled(params, execution, engine)
    if sculpt is None:
        solved = solve(
            points, params, sensors=sensors, classify=filter_interior, execution=execution, progress=progress
        )
        return solved.result(filter_interior=filter_interior)
    if not isinstance(sculpt, SculptFile):
        # A bad file is said before the cage is solved.
        sculpt = SculptFile.load(sculpt)
    face = solve_whole(points, params, purpose="sculpting", sensors=sensors, execution=execution, progress=progress)
    return face.sculpted(sculpt).result(filter_interior=filter_interior)


def orient_normals(
    points: ArrayLike,
    normals: ArrayLike,
    params: Params | None = None,
    *,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    up: ArrayLike | None = None,
    trusted: ArrayLike | None = None,
    execution: Execution | None = None,
    engine: EngineLike | None = None,
    progress: Progress | None = None,
) -> NDArray[np.floating]:
    """Turn the signs of normals that are given, so that they point outward; their lines stay as they are.

    Parameters
    ----------
    points, params, viewpoints, seen_from, up, execution, engine, progress
        As in `estimate_normals`, whose normals tell the side of each line; it is then settled along sheets.
    normals : (n, 3) array_like; (n, 2) of points in the plane
        Of any length but 0 and of either sign.
    trusted : (n,) array_like of bool, optional
        Normals that stay as they are, and whose side is handed on along the sheets that they are part of.

    Returns
    -------
    (n, d) array
        In the floating-point type of `normals`; each row is that of `normals`, or its negative.

    Raises
    ------
    ValueError
        Bad input; the message names the argument, what was found and what is allowed.
    MeshingError
        The space between the box and the balls could not be meshed.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> mixed = ball.normals.copy()
    >>> mixed[::2] *= -1
    >>> bool((orient_normals(ball.points, mixed) == ball.normals).all())
    True
    """
    refuse_in_plane(points, viewpoints=viewpoints, seen_from=seen_from, up=up)
    array = cloud.as_points(points, dimensions=cloud.SPACE_OR_PLANE)
    sensors = sensors_of(viewpoints, seen_from, up)
    params, execution = settled(params, execution, engine)
    # Bad normals are said before the cage is solved.
    given_lines(normals, len(array), array.shape[1])
    checked_trust(trusted, len(array))
    solved = solve(array, params, sensors=sensors, execution=execution, progress=progress)
    return solved.oriented(normals, trusted)


def reconstruct(
    points: ArrayLike,
    params: Params | None = None,
    *,
    screened: bool = True,
    depth: int | None = 8,
    filter_interior: bool = True,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    up: ArrayLike | None = None,
    backend: Backend | None = None,
    trim: float = 0.0,
    trim_distance: TrimDistance = "auto",
    sculpt: SculptFile | str | os.PathLike[str] | None = None,
    execution: Execution | None = None,
    engine: EngineLike | None = None,
    progress: Progress | None = None,
) -> Surface:
    """Reconstruct a surface, closed where the scan is: outward normals, no interior points, Poisson reconstruction.

    Parameters
    ----------
    points, params, viewpoints, seen_from, up, sculpt, execution, engine, progress
        As in `estimate_normals`.
    screened : bool
        Screened Poisson reconstruction, which passes nearer to the points, or the smoother unscreened one.
    depth : int or None
        Depth of the reconstruction's octree, 1 to 16; None: from the spacing of the points, at most 12.
    filter_interior : bool
        Leave out the points inside the object.
    backend : {"open3d", "pymeshlab"}, optional
        Host that reconstructs; by default whichever is installed.
    trim : float
        Fraction of the vertices to drop, those of lowest density. This opens the surface.
    trim_distance : float, "auto" or None
        Cut the surface where it is farther than this from the points that it was made from, in spacings: mean distances
        of a point to its 6 nearest others. "auto": 2 where the scan is open (`Result.open`), and closed bodies stay
        whole. None: nothing is cut, and what was not scanned is closed by a dome.

    Returns
    -------
    Surface

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> surface = reconstruct(sphere(500).points, depth=5)
    >>> surface.faces.shape[1]
    3
    """
    backend = check_arguments(depth, backend, trim, trim_distance)
    # Curves bound no surface: said before the cage is solved.
    array = cloud.as_points(points)
    params, execution = settled(params, execution, engine)
    result = estimate_normals(
        array,
        params,
        filter_interior=filter_interior,
        viewpoints=viewpoints,
        seen_from=seen_from,
        up=up,
        sculpt=sculpt,
        execution=execution,
        progress=progress,
    )
    keep = kept_points(result)
    report = progress or (lambda stage, fraction: None)
    report("surface", 0.0)
    start = time.perf_counter()
    given: dict[str, Any] = {"depth": depth, "screened": screened, "backend": backend, "open_at": result.open[keep]}
    vertices, faces, densities = poisson_reconstruction(
        array[keep], result.normals[keep], trim=trim, trim_distance=trim_distance, **given
    )
    timings = {**result.timings, "surface": time.perf_counter() - start}
    report("surface", 1.0)
    return Surface(vertices, faces, densities, result=dataclasses.replace(result, timings=timings))
