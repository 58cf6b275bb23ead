"""How the method is carried out: in tiles of which size, by whom, and with how much memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from types import TracebackType
from typing import Any, Protocol, TypeAlias, runtime_checkable

from face_plugin.checks import check_integer, check_number
from face_plugin.memory import GIGABYTE, available_memory

__all__ = ["DaskClient", "Engine", "EngineLike", "Execution", "Job", "allowed_memory"]

ENGINES = ("auto", "serial", "processes", "dask")
SMALLEST_TILE = 1000
"""A smaller tile would consist of its halo."""

Job = Callable[[str, int], int]
"""Does a tile of the store in a folder, and returns its number."""


@runtime_checkable
class Engine(Protocol):
    """Runs a job on every tile; a context manager."""

    def __enter__(self) -> Engine:
        """Start whatever the tiles will run on."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop it again."""

    def run(self, job: Job, folder: str, tiles: Sequence[int], done: Callable[[int], None]) -> None:
        """Run `job` on each tile, and call `done` with its number when it is finished."""


@runtime_checkable
class DaskClient(Protocol):
    """A `distributed.Client`, as far as it is told from an `Engine`."""

    def scheduler_info(self) -> Any:
        """Say which workers there are."""


EngineLike: TypeAlias = str | Engine | DaskClient


@dataclass(frozen=True)
class Execution:
    """Settings of the execution; None means derived from data and machine. NumPy's numbers are kept as Python's.

    Raises
    ------
    ValueError
        A field is outside its range; the message names it.

    Examples
    --------
    >>> Execution(tile_points=20_000, engine="serial").workers is None
    True
    """

    tile_points: int | None = None
    """Points of a tile, >= 1000; a cloud of no more is solved in one piece; None = tiles of 40,000 above 100,000."""
    max_memory: float | None = None
    """Memory that all processes together may take, in gigabytes (1e9 bytes); None = half of what is free."""
    engine: EngineLike = "auto"
    """Who solves tiles: "serial" = this process, "processes" = several of this machine, "dask" = Dask's workers, or
    the address of a Dask scheduler; "auto" is "processes" where more than one fits. In Python also a
    `distributed.Client`, or any object with the methods of `Engine`."""
    workers: int | None = None
    """Tiles solved at a time, >= 1; None = as many as there are cores."""

    def __post_init__(self) -> None:
        if self.tile_points is not None:
            check_integer(self, "tile_points", SMALLEST_TILE)
        if self.max_memory is not None:
            check_number(self, "max_memory", 0.0, math.inf)
        if self.workers is not None:
            check_integer(self, "workers", 1)
        if isinstance(self.engine, str):
            known = self.engine in ENGINES or "://" in self.engine
        else:
            known = isinstance(self.engine, (Engine, DaskClient))
        if not known:
            raise ValueError(
                f"engine must be one of {ENGINES}, an address such as 'tcp://host:8786', a Client or an Engine, "
                f"found {self.engine!r}"
            )

    @property
    def memory(self) -> float | None:
        """Bytes that are allowed; None where nothing is said of them."""
        return None if self.max_memory is None else self.max_memory * GIGABYTE

    def to_dict(self) -> dict[str, Any]:
        """Return the fields by name, for JSON.

        Raises
        ------
        ValueError
            The engine is an object.
        """
        if not isinstance(self.engine, str):
            raise ValueError(f"engine must be a name or an address to be written down, found {self.engine!r}")
        return {field.name: getattr(self, field.name) for field in fields(self)}


def allowed_memory(memory: float | None, share: float = 1.0) -> float:
    """Bytes that may be taken: those given, or by default this share of what is free.

    Examples
    --------
    >>> allowed_memory(2e9, 0.5)
    2000000000.0
    """
    return share * available_memory() if memory is None else memory
