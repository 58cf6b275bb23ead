"""A cloud on disk, sorted by tile, and what is known of each tile: all that engines and workers share.

A store is a folder. Workers map its arrays into memory, so that whoever hands out the tiles holds no points,
and write a file for each tile when it is done; a file is there whole or not at all, so that an interrupted
run can go on.
"""

from __future__ import annotations

import json
import os
import secrets
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.cloud import Frame
from face_plugin.io.disk import naming
from face_plugin.params import Params
from face_plugin.sides.sensors import Sensors

__all__ = ["Store", "Subset"]

VERSION = 7


@dataclass(frozen=True)
class Subset:
    """Points of a store inside a box."""

    points: NDArray[np.float64]
    """(k, 3) in the canonical frame."""
    tile: NDArray[np.int64]
    """(k,) the tile that owns each."""
    row: NDArray[np.int64]
    """(k,) the row of each in its tile."""


@dataclass(frozen=True)
class Store:
    """The description of a store; what it describes stays on disk.

    Attributes
    ----------
    folder : Path
    params : Params
    frame : Frame
    start : (t + 1,) int64
        The points of tile k are the rows ``start[k]`` to ``start[k + 1]``.
    bounds : (t, 2, 3) float64
        Lower and upper corner of each tile's points.
    dtype : dtype
        Floating-point type of the input.
    interior : bool
        Whether the points are to be classified.
    key : str
        Hash of the input and the settings.
    voxel : float
        Edge of the voxels of which the coarse cage has a point each.
    plane : (3,) float64 or None
        The normal of a cloud that lies in one plane.
    sensors : Sensors or None
        Where sensors stood, in the canonical frame.
    guessed : bool
        Whether they are stations that the density tells, and were not given.
    memory : float or None
        Bytes that meshing may take; None: all that are free.
    """

    folder: Path
    params: Params
    frame: Frame
    start: NDArray[np.int64]
    bounds: NDArray[np.float64]
    dtype: np.dtype[Any]
    interior: bool
    key: str
    voxel: float
    plane: NDArray[np.float64] | None = None
    sensors: Sensors | None = None
    guessed: bool = False
    memory: float | None = None

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return len(self.start) - 1

    @property
    def refines(self) -> bool:
        """Whether normals are refined, for which the first stage leaves what it knows of the sheets."""
        return self.params.angles == "refined" and self.plane is None

    @property
    def count(self) -> int:
        """Number of points."""
        return int(self.start[-1])

    def save(self) -> None:
        """Write the description. It comes last: a folder with one holds everything it describes."""
        text = json.dumps(
            {
                "version": VERSION,
                "key": self.key,
                "params": self.params.to_dict(),
                "origin": self.frame.origin.tolist(),
                "rotation": self.frame.rotation.tolist(),
                "scale": self.frame.scale,
                "start": self.start.tolist(),
                "bounds": self.bounds.tolist(),
                "dtype": self.dtype.name,
                "interior": self.interior,
                "voxel": self.voxel,
                "plane": None if self.plane is None else self.plane.tolist(),
                "sensors": None if self.sensors is None else self.sensors.to_dict(),
                "guessed": self.guessed,
                "memory": self.memory,
            }
        )
        temporary = self.folder / f"store.{secrets.token_hex(4)}.tmp"
        with naming(self.folder / "store.json"):
            temporary.write_text(text)
            os.replace(temporary, self.folder / "store.json")

    @classmethod
    def load(cls, folder: Path) -> Store:
        """Read the description of a store.

        Raises
        ------
        FileNotFoundError
            There is none, or it was never finished.
        ValueError
            It was made by another version, or is damaged.
        """
        with _undamaged(folder / "store.json"):
            return cls._of(folder, json.loads((folder / "store.json").read_text()))

    @classmethod
    def _of(cls, folder: Path, text: Any) -> Store:
        if text["version"] != VERSION:
            raise ValueError(f"a store of version {text['version']}, this package reads {VERSION}")
        frame = Frame(np.array(text["origin"]), np.array(text["rotation"]), text["scale"])
        return cls(
            folder=folder,
            params=Params(**text["params"]),
            frame=frame,
            start=np.array(text["start"], dtype=np.int64),
            bounds=np.array(text["bounds"]).reshape(-1, 2, 3),
            dtype=np.dtype(text["dtype"]),
            interior=text["interior"],
            key=text["key"],
            voxel=text["voxel"],
            plane=None if text["plane"] is None else np.array(text["plane"]),
            sensors=None if text["sensors"] is None else Sensors(**text["sensors"]),
            guessed=text["guessed"],
            memory=text["memory"],
        )

    def points(self, mode: Any = "r") -> NDArray[np.float64]:
        """Map all points (n, 3), sorted by tile, in the canonical frame."""
        return self._map("points.npy", mode)

    def rows(self, mode: Any = "r") -> NDArray[np.int64]:
        """Map the row (n,) in the input of each of them."""
        return self._map("rows.npy", mode)

    def _map(self, name: str, mode: Any) -> NDArray[Any]:
        with _undamaged(self.folder / name):
            return np.asanyarray(np.load(self.folder / name, mmap_mode=mode))

    def voxels(self, tile: int) -> NDArray[np.float64]:
        """Points (k, 3) of the coarse cage that a tile owns."""
        with _undamaged(self.folder / "voxels.npz"), np.load(self.folder / "voxels.npz") as arrays:
            return np.asarray(arrays["points"][arrays["tile"] == tile])

    def tile_points(self, tile: int) -> NDArray[np.float64]:
        """Points (k, 3) that a tile owns."""
        return np.array(self.points()[self.start[tile] : self.start[tile + 1]])

    def within(self, lower: NDArray[np.float64], upper: NDArray[np.float64]) -> Subset:
        """Every point inside a box, whichever tile owns it."""
        meets = (self.bounds[:, 0] <= upper).all(axis=1) & (self.bounds[:, 1] >= lower).all(axis=1)
        points, tiles, rows = [], [], []
        for tile in np.flatnonzero(meets):
            candidates = self.tile_points(int(tile))
            row = np.flatnonzero(((candidates >= lower) & (candidates <= upper)).all(axis=1))
            points.append(candidates[row])
            tiles.append(np.full(len(row), tile, dtype=np.int64))
            rows.append(row)
        if not points:
            return Subset(np.empty((0, 3)), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
        return Subset(np.concatenate(points), np.concatenate(tiles), np.concatenate(rows))

    def path(self, tile: int, stage: str) -> Path:
        """File of what a stage found out about a tile."""
        return self.folder / f"{stage}-{tile:06d}.npz"

    def done(self, tile: int, stage: str) -> bool:
        """Whether a stage has finished a tile."""
        return self.path(tile, stage).exists()

    def write(self, tile: int, stage: str, **arrays: NDArray[Any]) -> None:
        """Write what a stage found out about a tile, whole or not at all."""
        self.write_whole(self.path(tile, stage).stem, **arrays)

    def write_whole(self, name: str, **arrays: NDArray[Any]) -> None:
        """Write arrays to a file of the store, whole or not at all."""
        temporary = self.folder / f"{name}.{secrets.token_hex(4)}.tmp"
        try:
            with naming(self.folder / f"{name}.npz"):
                with open(temporary, "wb") as stream:
                    np.savez(stream, allow_pickle=False, **arrays)
                os.replace(temporary, self.folder / f"{name}.npz")
        finally:
            temporary.unlink(missing_ok=True)

    def read(self, tile: int, stage: str, *names: str) -> dict[str, NDArray[Any]]:
        """Read it back: what is named, or all of it."""
        with _undamaged(self.path(tile, stage)), np.load(self.path(tile, stage)) as arrays:
            return {name: arrays[name] for name in names or arrays.files}


@contextmanager
def _undamaged(path: Path) -> Iterator[None]:
    """Say of a file of a store that cannot be read which one it is: a folder to go on from is input like any other."""
    try:
        yield
    except (ValueError, TypeError, KeyError, EOFError, RecursionError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: nothing to go on from ({error}): remove {path.parent}, or do not resume") from error
