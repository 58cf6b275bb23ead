"""Outward normals as a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from numpy.typing import ArrayLike

from face_plugin.execution import Execution
from face_plugin.filters.base import Filter
from face_plugin.filters.pointset import PointSet
from face_plugin.params import Params
from face_plugin.sides.sensors import Sensors, sensors_of
from face_plugin.stages import Progress

__all__ = ["Normals", "with_sensors"]


def with_sensors(layer: PointSet, sensors: Sensors | None) -> PointSet:
    """Return `layer` with these sensors; as it is where there are none, or where it has the same.

    Examples
    --------
    >>> import numpy as np
    >>> layer = PointSet(np.eye(3))
    >>> with_sensors(layer, None) is layer
    True
    """
    if sensors is None or (layer.sensors is not None and layer.sensors.to_dict() == sensors.to_dict()):
        return layer
    return layer.replace(sensors=sensors)


@dataclass(frozen=True)
class Normals(Filter):
    """Give the kept points outward unit normals; attributes: ``strength``, ``confidence``, ``open`` and ``sides``.

    Parameters
    ----------
    params : Params, optional
        By default those of the cage solved so far, or the package's.
    viewpoints : (k, 3) array_like, optional
        Where sensors stood, in the unit of the points. In a chain the steps before see them as well.
    up : (3,) array_like, optional
        Direction from which all was seen, from afar.
    execution : Execution, optional
        Where a cage is solved: in tiles of which size, by whom, and with how much memory.

    Examples
    --------
    >>> from face_plugin.filters import PointSet
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(300)
    >>> bool(((Normals()(PointSet(ball.points)).normals * ball.normals).sum(axis=1) > 0).all())
    True
    """

    name: ClassVar[str] = "normals"
    params: Params | None = None
    viewpoints: ArrayLike | None = None
    up: ArrayLike | None = None
    execution: Execution | None = None

    def __post_init__(self) -> None:
        sensors = self.sensors
        if sensors is not None:
            # Plain values: steps are compared, and written to files.
            for name, value in sensors.to_dict().items():
                if name != "seen_from":
                    object.__setattr__(self, name, value)

    @property
    def sensors(self) -> Sensors | None:
        """Where sensors stood; None where nothing is said of them."""
        return sensors_of(self.viewpoints, None, self.up)

    def __call__(self, layer: PointSet, *, progress: Progress | None = None) -> PointSet:
        """Return `layer` with normals; those of points not kept are zero."""
        layer = with_sensors(layer, self.sensors)
        cage = layer.solved(self.params, progress, execution=self.execution)
        result = cage.result()
        attributes = {
            **layer.attributes,
            "strength": layer.scatter(result.strength),
            "confidence": layer.scatter(result.confidence),
            "open": layer.scatter(result.open),
            "sides": layer.scatter(result.sides),
        }
        return layer.replace(normals=layer.scatter(result.normals), attributes=attributes, cage=cage)
