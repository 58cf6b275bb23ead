"""Fill a store: three passes over the cloud, none of which holds it."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from face_plugin import cloud
from face_plugin.cloud import Frame
from face_plugin.execution import Execution, allowed_memory
from face_plugin.io.disk import allocated
from face_plugin.io.sources import CHUNK, Source
from face_plugin.params import Params
from face_plugin.sides.sensors import Sensors
from face_plugin.tiles.coarse import VOXELS_PER_POINT, Voxels, voxel_size
from face_plugin.tiles.partition import Partition, split
from face_plugin.tiles.plan import SHARE, fitting_tile_points
from face_plugin.tiles.store import Store

__all__ = ["SAMPLE", "fill_store", "store_key"]

log = logging.getLogger(__name__)

# Points that decide on the frame and on the tiles; smaller clouds decide for themselves, in any order. Fewer where
# the memory allowed does not hold so many, at about this many bytes each.
SAMPLE = (20_000, 1_000_000)
SAMPLE_BYTES = 1_000
# Points of the coarse cage: one in COARSE_SHARE, within these limits.
COARSE_SHARE = 40
COARSE_POINTS = (500, 6_000)
# Beyond that many points for each of the coarse ones, these become more.
MOST_A_COARSE = 500


def store_key(
    source: Source, params: Params, execution: Execution, interior: bool, sensors: Sensors | None = None
) -> str:
    """Hash of the input and of the settings that the outcome depends on."""
    # Of the execution only the size of the tiles has a share in what comes out.
    settings = {**params.to_dict(), "tile_points": execution.tile_points}
    text = json.dumps(
        [source.digest(), settings, interior, None if sensors is None else sensors.to_dict()], sort_keys=True
    )
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def fill_store(
    folder: Path,
    source: Source,
    params: Params,
    tile_points: int,
    *,
    interior: bool,
    key: str = "",
    chunk: int = CHUNK,
    memory: float | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> tuple[Store, Voxels]:
    """Sort a cloud into tiles on disk, and choose the points of the coarse cage.

    Parameters
    ----------
    folder : Path
        Exists; what it holds of the same names is overwritten.
    source : Source
        The cloud.
    params : Params
        Kept with the store.
    tile_points : int
        Number of points aimed at for a tile; as many tiles as that takes.
    interior : bool
        Whether the points are to be classified; kept with the store.
    key : str
        Kept with the store.
    chunk : int
        Points held at once.
    memory : float, optional
        Bytes that all processes together may take, kept with the store; by default a share of what is free.
    progress : callable, optional

    Returns
    -------
    Store
        Not saved yet: that marks it as finished, and the coarse cage is still missing.
    Voxels

    Raises
    ------
    ValueError
        The cloud is not finite, or too small or flat, as `face_plugin.cloud.prepare` says.
    """
    allowed = allowed_memory(memory, SHARE)
    sample = _sample(source, chunk, int(np.clip(allowed / SAMPLE_BYTES / 2, *SAMPLE)))
    prepared = cloud.prepare(sample)
    frame, plane = prepared.frame, prepared.plane_normal() if prepared.flat else None
    del prepared
    progress(0.25)
    unit_sample = frame.to_unit(sample)
    # Rounded up: a tile larger than asked for may not fit into the memory.
    partition = split(unit_sample, max(1, -(-source.count // tile_points)))
    target = max(int(np.clip(source.count // COARSE_SHARE, *COARSE_POINTS)), source.count // MOST_A_COARSE)
    target = fitting_tile_points(allowed, target)
    size = voxel_size(unit_sample, int(VOXELS_PER_POINT * target))
    # The sample may miss the outermost points: voxels start below any that there can be.
    origin = unit_sample.min(axis=0) - 1000 * size
    count, bounds, voxels = _count(source, frame, partition, origin, size, chunk)
    progress(0.5)
    start = np.concatenate([[0], np.cumsum(count)])
    dtype = cloud.as_points(np.empty((0, 3), source.dtype)).dtype
    store = Store(folder, params, frame, start, bounds, dtype, interior, key, size, plane, memory=memory)
    store.write_whole("voxels", points=voxels.points, tile=partition.assign(voxels.points))
    _place(store, source, partition, chunk)
    progress(1.0)
    log.info("%d points in %d tiles", store.count, store.tiles)
    return store, voxels


def _sample(source: Source, chunk: int, most: int) -> NDArray[np.float64]:
    """Return every k-th point of the cloud, at most so many, after all were found to be finite."""
    step = max(1, -(-source.count // most))
    kept, seen = [np.empty((0, 3))], 0
    for part, _ in source.parts(chunk):
        try:
            points = cloud.as_points(part)
        except ValueError as error:
            raise ValueError(f"{error} (rows counted from row {seen})" if seen else str(error)) from None
        kept.append(points[-seen % step :: step].astype(np.float64))
        seen += len(part)
    return np.concatenate(kept)


def _in_frame(source: Source, frame: Frame, chunk: int) -> Iterator[NDArray[np.float64]]:
    for part, _ in source.parts(chunk):
        yield frame.to_unit(part)


def _count(
    source: Source,
    frame: Frame,
    partition: Partition,
    origin: NDArray[np.float64],
    size: float,
    chunk: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64], Voxels]:
    """Points and bounds of each tile, and the voxels' points."""
    count = np.zeros(partition.tiles, dtype=np.int64)
    bounds = np.tile(np.array([[np.inf] * 3, [-np.inf] * 3]), (partition.tiles, 1, 1))
    voxels = Voxels(origin, size)
    for points in _in_frame(source, frame, chunk):
        tile = partition.assign(points)
        here = np.bincount(tile, minlength=partition.tiles)
        filled = np.flatnonzero(here)
        first = (np.cumsum(here) - here)[filled]
        by_tile = points[np.argsort(tile, kind="stable")]
        bounds[filled, 0] = np.minimum(bounds[filled, 0], np.minimum.reduceat(by_tile, first))
        bounds[filled, 1] = np.maximum(bounds[filled, 1], np.maximum.reduceat(by_tile, first))
        count += here
        voxels.add(points)
    return count, bounds, voxels


def _place(store: Store, source: Source, partition: Partition, chunk: int) -> None:
    """Write the points sorted by tile, and where each came from."""
    points_out = allocated(store.folder / "points.npy", np.float64, (store.count, 3))
    rows_out = allocated(store.folder / "rows.npy", np.int64, (store.count,))
    fill, seen = store.start[:-1].copy(), 0
    for points in _in_frame(source, store.frame, chunk):
        tile = partition.assign(points)
        order = np.argsort(tile, kind="stable")
        count = np.bincount(tile, minlength=store.tiles)
        within = np.arange(len(tile)) - np.repeat(np.cumsum(count) - count, count)
        place = fill[tile[order]] + within
        points_out[place] = points[order]
        rows_out[place] = seen + order
        fill += count
        seen += len(points)
    # Workers on other machines must find it.
    points_out.flush()
    rows_out.flush()
