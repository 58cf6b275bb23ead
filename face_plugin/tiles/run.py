"""Tiles from end to end: a source of points in, what is known of each point out."""

from __future__ import annotations

import dataclasses
import logging
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin import cloud
from face_plugin.execution import Engine, Execution, Job
from face_plugin.io.disk import allocated
from face_plugin.io.sources import CHUNK, ArraySource, Source
from face_plugin.params import Params, settled
from face_plugin.result import Result
from face_plugin.sides import enclosure
from face_plugin.sides.sensors import Sensors
from face_plugin.stages import Clock, Progress
from face_plugin.tiles.coarse import Voxels, solve_coarse
from face_plugin.tiles.parts import known_of
from face_plugin.tiles.plan import make_engine, tile_size
from face_plugin.tiles.prepare import fill_store, store_key
from face_plugin.tiles.scene import write_far
from face_plugin.tiles.stations import stations_of
from face_plugin.tiles.store import Store
from face_plugin.tiles.tile import ORIENT_STAGES, TILE_STAGES, one_thread, orient_tile, solve_tile

__all__ = ["collect", "estimate_tiled", "solve_store", "tile_seconds"]

log = logging.getLogger(__name__)


def estimate_tiled(
    points: ArrayLike,
    params: Params | None = None,
    *,
    sensors: Sensors | None = None,
    filter_interior: bool = False,
    execution: Execution | None = None,
    progress: Progress | None = None,
) -> Result:
    """Outward normals of a large cloud, solved in tiles; arguments and result as of `estimate_normals`.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit
    params : Params, optional
    sensors : Sensors, optional
        Where sensors stood, in the unit of the points.
    filter_interior : bool
        Also classify the points as interior or not.
    execution : Execution, optional
    progress : callable, optional
        ``progress(stage, fraction)`` with the stages "cloud", "coarse", "tiles" and "normals".

    Returns
    -------
    Result
        The same to the last bit for every engine and number of workers.

    Raises
    ------
    ValueError
        Bad input, as of `estimate_normals`, or less memory allowed than a tile needs.
    MeshingError
        A tile could not be meshed.
    FaceError
        Workers died again and again.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(3000)
    >>> normals = estimate_tiled(ball.points, execution=Execution(tile_points=1500, engine="serial")).normals
    >>> bool(((normals * ball.normals).sum(axis=1) > 0).all())
    True
    """
    params, execution = settled(params, execution)
    source = ArraySource(cloud.as_points(points))
    with tempfile.TemporaryDirectory(prefix="face-") as folder:
        store, timings = solve_store(
            Path(folder),
            source,
            params,
            sensors=sensors,
            classify=filter_interior,
            execution=execution,
            progress=progress,
        )
        found = collect(store)
        if filter_interior:
            params = dataclasses.replace(params, alpha=interior_alpha(store))
        return Result(
            normals=found["normals"],
            strength=found["strength"],
            confidence=found["confidence"],
            interior=found.get("interior"),
            timings={**timings, **tile_seconds(store)},
            params=params,
            strays=found["strays"],
            open=found["open"],
            sides=found["sides"],
        )


def solve_store(
    folder: Path,
    source: Source,
    params: Params,
    *,
    sensors: Sensors | None = None,
    classify: bool = False,
    execution: Execution | None = None,
    resume: bool = False,
    chunk: int = CHUNK,
    progress: Progress | None = None,
) -> tuple[Store, dict[str, float]]:
    """Solve all tiles of a cloud in a folder.

    Parameters
    ----------
    folder : Path
        Exists; with Dask, at the same place for all workers.
    source : Source
    params : Params
    sensors : Sensors, optional
        Where sensors stood.
    classify : bool
        Also tell which points lie inside.
    execution : Execution, optional
    resume : bool
        Go on from what the folder holds.
    chunk : int
        Points of the source held at once.
    progress : callable, optional

    Returns
    -------
    store : Store
        Every tile of it is done.
    timings : dict of str to float
        Seconds by stage as they passed.

    Raises
    ------
    ValueError
        With `resume`: the folder holds work on another input or with other settings.
    """
    params, execution = settled(params, execution)
    clock, report = Clock(progress), progress or (lambda stage, fraction: None)
    if sensors is not None and sensors.seen_from is not None:
        raise ValueError(
            f"seen_from cannot be given for {source.count} points, which are solved in tiles: give viewpoints alone, "
            "or a larger Execution.tile_points"
        )
    key = store_key(source, params, execution, classify, sensors)
    store = _found(folder, key) if resume else None
    points = tile_size(source.count, execution)
    with make_engine(execution, points, source.count) as running:
        if store is None:
            with clock("cloud"):
                store, voxels = fill_store(
                    folder, source, params, points, interior=classify, key=key, chunk=chunk, memory=execution.memory
                )
            with clock("coarse"):
                _solve_coarse(voxels, store)
            if sensors is not None:
                store = dataclasses.replace(store, sensors=sensors.in_frame(store.frame))
            store.save()
        with clock("tiles"):
            _run(running, solve_tile, store, "field", "tiles", report)
        with clock("normals"):
            write_far(store)
            if store.sensors is None:
                stations = stations_of(store)
                if stations is not None:
                    store = dataclasses.replace(store, sensors=stations, guessed=True)
                    store.save()
            _run(running, orient_tile, store, "normals", "normals", report)
    return store, clock.seconds


def _solve_coarse(voxels: Voxels, store: Store) -> None:
    with one_thread():
        solve_coarse(voxels, store.params, store.memory).save(store.folder)


def _found(folder: Path, key: str) -> Store | None:
    """Return the store that an earlier run left, if it got so far."""
    try:
        store = Store.load(folder)
    except FileNotFoundError:
        return None
    if store.key != key:
        raise ValueError(f"{folder} holds work on another input or with other settings: remove it, or do not resume")
    return store


def _run(engine: Engine, job: Job, store: Store, stage: str, name: str, report: Progress) -> None:
    """Run a job on the tiles that a stage has not finished; it is reported as `name`."""
    left = [tile for tile in range(store.tiles) if not store.done(tile, stage)]
    if len(left) < store.tiles:
        log.info("%d of %d tiles are done already", store.tiles - len(left), store.tiles)
    remaining = len(left)

    def done(tile: int) -> None:
        nonlocal remaining
        remaining -= 1
        report(name, 1.0 - remaining / store.tiles)

    # The largest first: the last ones to finish then keep no worker waiting for long.
    left.sort(key=lambda tile: (store.start[tile] - store.start[tile + 1], tile))
    engine.run(job, str(store.folder), left, done)


def collect(store: Store, folder: Path | None = None) -> dict[str, NDArray[Any]]:
    """Bring what the tiles say into the order of the input.

    Parameters
    ----------
    store : Store
        All tiles done.
    folder : Path, optional
        Map the arrays from files there instead of holding them.

    Returns
    -------
    dict of str to (n, ...) array
        "normals", "strength", "confidence", "strays", "open", "sides", and "interior" where the store asks for it.
    """
    kinds: dict[str, tuple[Any, tuple[int, ...]]] = {
        "normals": (store.dtype, (store.count, 3)),
        "strength": (store.dtype, (store.count,)),
        "confidence": (store.dtype, (store.count,)),
        "strays": (np.bool_, (store.count,)),
        "open": (np.bool_, (store.count,)),
        "sides": (np.uint8, (store.count,)),
    }
    if store.interior:
        kinds["interior"] = (np.bool_, (store.count,))

    def empty(name: str) -> NDArray[Any]:
        dtype, shape = kinds[name]
        if folder is None:
            return np.empty(shape, dtype)
        return allocated(folder / f"{name}.npy", dtype, shape)

    out = {name: empty(name) for name in kinds}
    rows = store.rows()
    alpha = interior_alpha(store) if store.interior else 0.0
    known = known_of(store)
    for tile in range(store.tiles):
        row = rows[store.start[tile] : store.start[tile + 1]]
        oriented = store.read(tile, "normals")
        solved = store.read(tile, "field")
        out["normals"][row] = store.frame.unrotate(oriented["normals"])
        out["confidence"][row] = oriented["confidence"]
        out["strength"][row] = solved["strength"]
        out["strays"][row] = solved["stray"]
        like = known.nearest(store.tile_points(tile))
        out["open"][row], out["sides"][row] = known.open[like], known.sides[like]
        out["confidence"][row] *= known.borne_out[like]
        if known.nesting is not None:
            turned = row[known.nesting.turned[like]]
            out["normals"][turned] *= -1
        if store.interior:
            inside = solved["e_max"] < alpha
            if known.nesting is not None:
                inside &= ~known.nesting.inner[like]
            out["interior"][row] = inside & oriented["enclosed"] if store.params.alpha == "auto" else inside
    return out


def interior_alpha(store: Store) -> float:
    """Field strength below which space is shielded: given, or what the whole cloud shows."""

    def of_enclosed() -> NDArray[np.float64]:
        strength = []
        for tile in range(store.tiles):
            # What is not enclosed does not count, and need not be kept.
            deep = store.read(tile, "normals", "enclosed")["enclosed"]
            strength.append(store.read(tile, "field", "strength")["strength"][deep])
        return np.concatenate(strength)

    return enclosure.threshold(store.params.alpha, of_enclosed)


def tile_seconds(store: Store) -> dict[str, float]:
    """Processor seconds by stage that the tiles took, all together: those that passed depend on who else works here."""
    seconds: dict[str, float] = {}
    for stage, names in (("field", TILE_STAGES), ("normals", ORIENT_STAGES)):
        for tile in range(store.tiles):
            for name, value in zip(names, store.read(tile, stage, "seconds")["seconds"], strict=True):
                label = f"tiles: {name}"
                seconds[label] = seconds.get(label, 0.0) + float(value)
    return seconds
