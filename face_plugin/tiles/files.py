"""Clouds larger than memory: a file in, a file with normals out, only parts in between."""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.execution import Execution, allowed_memory
from face_plugin.io.arrays import in_plane
from face_plugin.io.cloudfile import replacing
from face_plugin.io.disk import claimed
from face_plugin.io.sinks import WRITERS, Columns
from face_plugin.io.sources import STREAMED, Source, open_source
from face_plugin.params import Params, settled
from face_plugin.result import Side
from face_plugin.sides.sensors import Sensors
from face_plugin.stages import Progress
from face_plugin.tiles.plan import PROCESS_BYTES, SHARE
from face_plugin.tiles.run import collect, solve_store

__all__ = ["FileResult", "normals_of_file", "streams", "work_folder"]

log = logging.getLogger(__name__)

# Bytes that a point takes in memory on the way from one file to another, with a few attributes.
HELD_BYTES = 300
# Points in a part: a part takes about a hundred bytes a point on its way, a few times over.
PART_BYTES = 1_000
PART_POINTS = (20_000, 1_000_000)

_NORMALS_OF_OLD = {"nx", "ny", "nz", "NormalX", "NormalY", "NormalZ"}


@dataclass(frozen=True)
class FileResult:
    """What was done to a file."""

    points: int
    """Points read."""
    written: int
    """Points written."""
    interior: int | None
    """Points inside the object, where they were classified."""
    strays: int
    """Points too far from everything to belong to a surface."""
    mean_confidence: float
    sides: dict[str, int]
    """Points by what told their side: chosen, field, sensors."""
    timings: dict[str, float]
    """Seconds by stage."""
    params: Params


def work_folder(output: Path) -> Path:
    """Folder beside the output in which the tiles of a run are kept."""
    return output.with_name(f".{output.name}.face")


def streams(source: Path, output: Path, execution: Execution) -> bool:
    """Whether a file is too large for the memory allowed and can be worked on in parts.

    Examples
    --------
    >>> streams(Path("cloud.xyz"), Path("cloud.ply"), Execution())
    False
    """
    if source.suffix.lower() not in STREAMED or output.suffix.lower() not in STREAMED:
        return False
    if source.suffix.lower() == ".npy" and in_plane(source):
        return False
    return open_source(source).count * HELD_BYTES + PROCESS_BYTES > allowed_memory(execution.memory, SHARE)


def normals_of_file(
    source: str | os.PathLike[str],
    output: str | os.PathLike[str],
    params: Params | None = None,
    *,
    sensors: Sensors | None = None,
    filter_interior: bool = False,
    mark_interior: bool = False,
    scalars: bool = False,
    execution: Execution | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> FileResult:
    """Estimate the normals of a cloud that need not fit into memory.

    The work is kept in a folder beside the output, named as `work_folder` says, and removed with the last
    byte written. If the run is interrupted it stays, and `resume` goes on from there.

    Parameters
    ----------
    source, output : path
        NPY, binary PLY, LAS or LAZ, of the same kind or not. The point attributes are kept where the
        output's format can hold them; other elements of a PLY, such as faces, are not.
    params : Params, optional
    sensors : Sensors, optional
        Where sensors stood, in the unit of the points.
    filter_interior : bool
        Leave out the points inside the object, and strays.
    mark_interior : bool
        Write whether each point is inside, as ``interior`` (0 or 1).
    scalars : bool
        Write ``strength``, ``confidence`` and ``sides`` of each point.
    execution : Execution, optional
    resume : bool
        Go on from what an interrupted run left.
    progress : callable, optional

    Returns
    -------
    FileResult

    Raises
    ------
    ValueError
        A file that cannot be read or written in parts; or, with `resume`, work on another input or with
        other settings.
    OSError
        A file cannot be opened or written, or another run is writing the output (`BlockingIOError`).

    Examples
    --------
    >>> import tempfile
    >>> from face_plugin.shapes import sphere
    >>> folder = Path(tempfile.mkdtemp())
    >>> np.save(folder / "ball.npy", sphere(3000).points)
    >>> serial = Execution(tile_points=1500, engine="serial")
    >>> normals_of_file(folder / "ball.npy", folder / "ball.ply", execution=serial).written
    3000
    """
    source, output, (params, execution) = Path(source), Path(output), settled(params, execution)
    if output.suffix.lower() not in WRITERS:
        raise ValueError(f"{output}: cannot be written in parts; allowed are {', '.join(WRITERS)}")
    report = progress or (lambda stage, fraction: None)
    opened = open_source(source)
    chunk = int(np.clip(allowed_memory(execution.memory, SHARE) / 4 / PART_BYTES, *PART_POINTS))
    folder = work_folder(output)
    interior = filter_interior or mark_interior
    with _working(folder, output, resume):
        store, timings = solve_store(
            folder,
            opened,
            params,
            sensors=sensors,
            classify=interior,
            execution=execution,
            resume=resume,
            progress=progress,
            chunk=chunk,
        )
        report("write", 0.0)
        found = collect(store, folder)
        inside = int(np.count_nonzero(found["interior"])) if interior else None
        strays = int(np.count_nonzero(found["strays"]))
        keep = ~np.asarray(found["interior"] | found["strays"]) if filter_interior else None
        written = opened.count if keep is None else int(np.count_nonzero(keep))
        extra = [name for name, wanted in _extras(scalars, mark_interior) if wanted]
        parts = columns_of(opened, found, extra, keep=keep, chunk=chunk)
        with replacing(output) as temporary:
            WRITERS[output.suffix.lower()](temporary, written, parts, opened)
        mean_confidence, sides = float(found["confidence"].mean()), Side.count(found["sides"])
        report("write", 1.0)
        # The folder can be removed where nothing in it is mapped any more.
        del found, parts
    return FileResult(
        points=opened.count,
        written=written,
        interior=inside,
        strays=strays,
        mean_confidence=mean_confidence,
        sides=sides,
        timings=timings,
        params=params,
    )


@contextmanager
def _working(folder: Path, output: Path, resume: bool) -> Iterator[None]:
    """Have a folder to work in, alone; it stays where a run that fails has left something to go on from."""
    with claimed(folder.with_name(f"{folder.name}.lock"), output):
        if folder.exists() and not resume:
            shutil.rmtree(folder)
        try:
            folder.mkdir(exist_ok=True)
            yield
        except BaseException as error:
            if (folder / "store.json").exists():
                log.warning("what was done is kept in %s for --resume", folder)
            else:
                shutil.rmtree(folder, ignore_errors=True)
            if isinstance(error, OSError) and folder in [Path(str(error.filename)), *Path(str(error.filename)).parents]:
                # Of what is in there nobody has heard.
                raise OSError(error.errno, error.strerror, str(output)) from error
            raise
        shutil.rmtree(folder)


def _extras(scalars: bool, mark_interior: bool) -> list[tuple[str, bool]]:
    return [("strength", scalars), ("confidence", scalars), ("sides", scalars), ("interior", mark_interior)]


def columns_of(
    source: Source, found: dict[str, NDArray[Any]], extra: list[str], *, keep: NDArray[np.bool_] | None, chunk: int
) -> Iterator[Columns]:
    """Yield the columns to write, `chunk` points of the input at a time.

    Parameters
    ----------
    source : Source
    found : dict of str to (n, ...) array
        As `face_plugin.tiles.run.collect` gives it.
    extra : list of str
        Names of what is to be written beside the normals.
    keep : (n,) bool or None
        Points to write; None: all.
    chunk : int
    """
    seen = 0
    for points, attributes in source.parts(chunk):
        part = slice(seen, seen + len(points))
        columns: Columns = {axis: points[:, k] for k, axis in enumerate("xyz")}
        columns.update({f"n{axis}": found["normals"][part, k] for k, axis in enumerate("xyz")})
        columns.update({k: v for k, v in attributes.items() if k not in _NORMALS_OF_OLD})
        for name in extra:
            values = found[name][part]
            columns[name] = values.astype(np.uint8) if values.dtype == np.bool_ else values
        if keep is not None:
            columns = {name: values[keep[part]] for name, values in columns.items()}
        seen += len(points)
        yield columns
