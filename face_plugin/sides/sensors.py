"""Where sensors stood, as a user tells it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.cloud import Frame
from face_plugin.threads import KDTree

__all__ = ["MOST_VIEWPOINTS", "Sensors", "sensors_of"]

# Viewpoints of a trajectory that stand for all.
MOST_VIEWPOINTS = 12


@dataclass(frozen=True, eq=False)
class Sensors:
    """Where sensors stood, in the unit of the points.

    Raises
    ------
    ValueError
        Wrong shape, nothing finite, or rows that name no viewpoint.

    Examples
    --------
    >>> Sensors(viewpoints=[[0.0, 0.0, 2.0]]).viewpoints.shape
    (1, 3)
    """

    viewpoints: ArrayLike | None = None
    """(k, 3) positions."""
    seen_from: ArrayLike | None = None
    """(n,) row of the viewpoint that saw each point, -1 where that is not known."""
    up: ArrayLike | None = None
    """(3,) direction from which all was seen, from afar; of any length."""

    def __post_init__(self) -> None:
        if self.viewpoints is None and self.up is None:
            raise ValueError("viewpoints or up must be given with seen_from, found neither")
        if self.viewpoints is not None:
            object.__setattr__(self, "viewpoints", _finite("viewpoints", self.viewpoints, 2))
        if self.up is not None:
            up = _finite("up", self.up, 1)
            if not up.any():
                raise ValueError("up must be a direction, found a vector of length 0")
            object.__setattr__(self, "up", up)
        if self.seen_from is not None:
            self._check_rows()

    def _check_rows(self) -> None:
        if self.viewpoints is None:
            raise ValueError("seen_from names rows of viewpoints, and there are none")
        rows = np.asarray(self.seen_from)
        if rows.ndim != 1 or rows.dtype.kind not in "iu":
            raise ValueError(f"seen_from must be an (n,) array of integers, found {rows.shape} of {rows.dtype}")
        count = len(np.asarray(self.viewpoints))
        if len(rows) and (rows.min() < -1 or rows.max() >= count):
            raise ValueError(
                f"seen_from must hold rows of viewpoints, 0 to {count - 1}, or -1; found {rows.min()} to {rows.max()}"
            )
        object.__setattr__(self, "seen_from", rows.astype(np.intp))

    def to_dict(self) -> dict[str, Any]:
        """Return the fields by name, for JSON."""
        fields = {"viewpoints": self.viewpoints, "seen_from": self.seen_from, "up": self.up}
        return {name: None if value is None else np.asarray(value).tolist() for name, value in fields.items()}

    def of(self, kept: NDArray[np.bool_]) -> Sensors:
        """Return those of the points (n,) that are kept."""
        if self.seen_from is None or kept.all():
            return self
        return Sensors(self.viewpoints, self._rows(len(kept))[kept], self.up)

    def about(self, points: NDArray[np.float64]) -> Sensors:
        """Leave out, of more viewpoints than are looked from, those that are the nearest to none of the points (m, 3).

        A part of a long street is seen from what little of the trajectory passes it.

        Examples
        --------
        >>> drive = Sensors(np.arange(100.0)[:, None] * [1.0, 0.0, 0.0])
        >>> drive.about(np.array([[3.2, 5.0, 0.0], [7.9, -5.0, 0.0]])).viewpoints[:, 0]
        array([3., 8.])
        """
        views = np.asarray(self.viewpoints)
        if self.viewpoints is None or self.seen_from is not None or len(views) <= MOST_VIEWPOINTS:
            return self
        return Sensors(views[np.unique(KDTree(views).query(points)[1])], None, self.up)

    def _rows(self, count: int) -> NDArray[np.intp]:
        """Rows of the viewpoints, one for each of so many points."""
        rows = np.asarray(self.seen_from)
        if len(rows) != count:
            raise ValueError(f"seen_from must have a row for each of the {count} points, found {len(rows)}")
        return rows

    def in_frame(self, frame: Frame, rows: NDArray[np.intp] | None = None) -> Sensors:
        """Return them in the canonical frame; `rows` (n,) tells which distinct point each input point became."""
        viewpoints, up, seen_from = self.viewpoints, self.up, self.seen_from
        if viewpoints is not None:
            viewpoints = frame.to_unit(np.asarray(viewpoints))
        if up is not None:
            up = frame.rotate(np.asarray(up)[None])[0]
        if seen_from is not None and rows is not None:
            given = self._rows(len(rows))
            distinct = np.full(int(rows.max()) + 1, -1, dtype=np.intp)
            distinct[rows[given >= 0]] = given[given >= 0]
            seen_from = distinct
        return Sensors(viewpoints, seen_from, up)


def sensors_of(
    viewpoints: ArrayLike | None = None, seen_from: ArrayLike | None = None, up: ArrayLike | None = None
) -> Sensors | None:
    """Sensors from loose arguments; None where none is given."""
    if viewpoints is None and seen_from is None and up is None:
        return None
    return Sensors(viewpoints, seen_from, up)


def _finite(name: str, values: ArrayLike, dimensions: int) -> NDArray[np.float64]:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must hold numbers, found {type(values).__name__}") from None
    if name == "viewpoints" and array.shape == (3,):
        array = array[None]
    shape = "(k, 3)" if dimensions == 2 else "(3,)"
    if array.ndim != dimensions or array.shape[-1] != 3 or array.size == 0:
        raise ValueError(f"{name} must have the shape {shape}, found {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, found NaN or infinity")
    return array
