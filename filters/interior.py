"""The interior test as a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from face_plugin.execution import Execution
from face_plugin.filters.base import Filter
from face_plugin.filters.pointset import PointSet
from face_plugin.params import Params
from face_plugin.stages import Progress

__all__ = ["Interior"]


@dataclass(frozen=True)
class Interior(Filter):
    """Keep no point that lies inside the object, and no stray; the attribute ``interior`` tells which lie inside.

    Parameters
    ----------
    alpha : float or {"auto", "dense", "sparse"}, optional
        Field strength below which space counts as inside, as in `Params`; another value needs no new solve.
    params : Params, optional
        By default those of the cage solved so far, or the package's.
    execution : Execution, optional
        Where a cage is solved: in tiles of which size, by whom, and with how much memory.

    Examples
    --------
    >>> from face_plugin.filters import PointSet
    >>> from face_plugin.shapes import nested_box
    >>> layer = Interior()(PointSet(nested_box(600).points))
    >>> bool((layer.keep == ~layer.attributes["interior"]).all())
    True
    """

    name: ClassVar[str] = "interior"
    alpha: float | str | None = None
    params: Params | None = None
    execution: Execution | None = None

    def __post_init__(self) -> None:
        if self.alpha is not None:
            # Params is the judge of what an alpha may be.
            options: dict[str, Any] = {"alpha": self.alpha}
            Params(**options)

    def __call__(self, layer: PointSet, *, progress: Progress | None = None) -> PointSet:
        """Return `layer` with the interior points out of ``keep``; normals stay as they are."""
        cage = layer.replace(classify=True).solved(self.params, progress, execution=self.execution)
        inside = layer.scatter(cage.interior(self.alpha))
        keep = layer.keep & ~inside & ~layer.scatter(cage.strays)
        return layer.replace(keep=keep, attributes={**layer.attributes, "interior": inside})
