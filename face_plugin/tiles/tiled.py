"""A cloud too large for one piece, behind the part of `FaCE` that needs no field between the points."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.execution import Execution
from face_plugin.params import Params, settled
from face_plugin.result import Result
from face_plugin.sides.given import checked_trust, given_lines
from face_plugin.sides.sensors import Sensors
from face_plugin.stages import Progress
from face_plugin.tiles.run import estimate_tiled

__all__ = ["Tiled"]


class Tiled:
    """Normals and interior test of a cloud in tiles, each solved when it is asked for and kept.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit
    params : Params, optional
    sensors : Sensors, optional
        Where sensors stood; which of them saw which point cannot be given in tiles.
    classify : bool
        Classify the points in the pass for the normals: cheaper than another pass, if it will be asked for.
    execution : Execution, optional
    progress : callable, optional
        ``progress(stage, fraction)``.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(2500)
    >>> tiled = Tiled(ball.points, execution=Execution(tile_points=1500, engine="serial"))
    >>> bool(((tiled.result().normals * ball.normals).sum(axis=1) > 0).all())
    True
    """

    def __init__(
        self,
        points: ArrayLike,
        params: Params | None = None,
        *,
        sensors: Sensors | None = None,
        classify: bool = False,
        execution: Execution | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.params, self.execution = settled(params, execution)
        self._points, self._classify, self._progress = points, classify, progress
        self._sensors = sensors
        self._result: Result | None = None

    def result(self, *, filter_interior: bool = False) -> Result:
        """Everything that is known of the points; which are interior where that was, or is now, asked for."""
        if self._result is None or (filter_interior and self._result.interior is None):
            self._result = self._solve(self.params, self._classify or filter_interior)
        return self._result

    def interior(self, alpha: float | str | None = None) -> NDArray[np.bool_]:
        """Which points (n,) lie inside the object; another `alpha` than that of the settings needs a pass."""
        options: dict[str, Any] = {} if alpha is None else {"alpha": alpha}
        params = dataclasses.replace(self.params, **options)
        result = self.result(filter_interior=True) if params == self.params else self._solve(params, True)
        assert result.interior is not None  # it was asked for
        return result.interior

    def oriented(self, normals: ArrayLike, trusted: ArrayLike | None = None) -> NDArray[np.floating]:
        """Turn the signs of normals (n, 3) that are given, as `face_plugin.orient_normals` does.

        Raises
        ------
        ValueError
            Some are trusted: what they say is handed on in one piece only.
        """
        result = self.result()
        given, lines = given_lines(normals, len(result.normals))
        if checked_trust(trusted, len(lines)) is not None:
            raise ValueError("trusted needs the cloud in one piece: a larger Execution.tile_points or max_memory")
        side = np.einsum("nd,nd->n", lines, result.normals)
        return np.where(side[:, None] < 0, -given, given)

    @property
    def strays(self) -> NDArray[np.bool_]:
        """Which points (n,) lie too far from everything to belong to a surface."""
        return self.result().strays

    def _solve(self, params: Params, classify: bool) -> Result:
        return estimate_tiled(
            self._points,
            params,
            sensors=self._sensors,
            filter_interior=classify,
            execution=self.execution,
            progress=self._progress,
        )
