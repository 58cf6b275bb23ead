"""What runs through a chain: points, what is known of each, and which are kept."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.cloud import SPACE_OR_PLANE, as_points
from face_plugin.estimate import solve
from face_plugin.execution import Execution
from face_plugin.params import Params
from face_plugin.result import Mesh
from face_plugin.sides.sensors import Sensors
from face_plugin.solver import FaCE
from face_plugin.stages import Progress
from face_plugin.tiles import Tiled

__all__ = ["PointSet"]


@dataclass(frozen=True, eq=False)
class PointSet:
    """Points in the order of the input, with what the steps so far found out; no step removes a row.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit; or (n, 2) in the plane
    normals : (n, d) array_like of float, optional
        Rows of points that are not kept may be zero.
    keep : (n,) array_like of bool, optional
        Points that later steps use; all by default.
    attributes : mapping of str to (n, ...) array_like, optional
        Anything else there is one of for each point.
    surface : Mesh, optional
    cage : FaCE or Tiled, optional
        The solved cage of the kept points, so that steps share one solve.
    sensors : Sensors, optional
        Where sensors stood, for every cage that is solved.
    classify : bool
        Whether a later step will ask for interior points; a large cloud is then classified in the same pass.

    Raises
    ------
    ValueError
        Wrong shape or length, or points that are not finite; the message names the argument.

    Examples
    --------
    >>> import numpy as np
    >>> layer = PointSet(np.eye(3), keep=[True, True, False], attributes={"label": [1, 2, 3]})
    >>> len(layer), layer.kept().attributes["label"].tolist()
    (3, [1, 2])
    """

    points: NDArray[np.floating]
    normals: NDArray[np.floating] | None = None
    keep: NDArray[np.bool_] = None  # type: ignore[assignment]  # all points, once their number is known
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    surface: Mesh | None = None
    cage: FaCE | Tiled | None = None
    classify: bool = False
    sensors: Sensors | None = None

    def __post_init__(self) -> None:
        points = as_points(self.points, dimensions=SPACE_OR_PLANE)
        count = len(points)
        self._set("points", points)
        if self.normals is not None:
            normals = np.asarray(self.normals)
            if normals.shape != points.shape or normals.dtype.kind != "f":
                found = f"{normals.shape} of {normals.dtype}"
                raise ValueError(f"normals must be {points.shape} of floats as the points are, found {found}")
            self._set("normals", normals)
        keep = np.ones(count, dtype=np.bool_) if self.keep is None else np.asarray(self.keep)
        if keep.shape != (count,) or keep.dtype != np.bool_:
            raise ValueError(f"keep must hold {count} booleans, found {keep.shape} of {keep.dtype}")
        self._set("keep", keep)
        attributes = {name: np.asarray(values) for name, values in self.attributes.items()}
        for name, values in attributes.items():
            if values.ndim == 0 or len(values) != count:
                raise ValueError(f"attribute {name!r} must hold {count} rows, found shape {values.shape}")
        object.__setattr__(self, "attributes", MappingProxyType(attributes))

    def _set(self, name: str, array: NDArray[Any]) -> None:
        """Store a view that cannot be written through: copies of a layer share their arrays."""
        view = array.view()
        view.flags.writeable = False
        object.__setattr__(self, name, view)

    def __len__(self) -> int:
        """Return the number n of points, kept or not."""
        return len(self.points)

    def replace(self, **changes: Any) -> PointSet:
        """Return a copy with other fields; the solved cage goes when the kept points or the sensors change.

        Examples
        --------
        >>> import numpy as np
        >>> PointSet(np.eye(3)).replace(keep=[True, False, True]).keep.tolist()
        [True, False, True]
        """
        if {"points", "keep", "sensors"} & changes.keys():
            changes.setdefault("cage", None)
        return dataclasses.replace(self, **changes)

    def kept(self) -> PointSet:
        """Return the kept points alone, with their normals and attributes."""
        return PointSet(
            self.points[self.keep],
            None if self.normals is None else self.normals[self.keep],
            attributes={name: values[self.keep] for name, values in self.attributes.items()},
            surface=self.surface,
            cage=self.cage,
            sensors=self.sensors_of_kept(),
        )

    def solved(
        self, params: Params | None = None, progress: Progress | None = None, *, execution: Execution | None = None
    ) -> FaCE | Tiled:
        """Return the cage of the kept points: the one at hand, unless `params` asks for another."""
        if self.cage is not None and (params is None or params == self.cage.params):
            return self.cage
        return solve(
            self.points[self.keep],
            params,
            sensors=self.sensors_of_kept(),
            classify=self.classify,
            execution=execution,
            progress=progress,
        )

    def sensors_of_kept(self) -> Sensors | None:
        """Return the sensors, with the rows of the kept points alone."""
        return None if self.sensors is None else self.sensors.of(self.keep)

    def scatter(self, values: NDArray[Any]) -> NDArray[Any]:
        """Spread values of the kept points over all n rows; the other rows are zero."""
        full = np.zeros((len(self), *values.shape[1:]), dtype=values.dtype)
        full[self.keep] = values
        return full
