"""A cloud too large for one piece, behind the part of `FaCE` that the steps use."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.estimate import estimate_normals
from face_plugin.params import Params
from face_plugin.result import Progress, Result

__all__ = ["Tiled"]


class Tiled:
    """Normals and interior test of a cloud in tiles, each solved when it is asked for and kept.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit
    params : Params
    classify : bool
        Classify the points in the pass for the normals: cheaper than another pass, if it will be asked for.
    progress : callable, optional
        ``progress(stage, fraction)``.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(2500)
    >>> tiled = Tiled(ball.points, Params(tile_points=1500, engine="serial"))
    >>> bool(((tiled.result().normals * ball.normals).sum(axis=1) > 0).all())
    True
    """

    def __init__(
        self, points: ArrayLike, params: Params, *, classify: bool = False, progress: Progress | None = None
    ) -> None:
        self.params = params
        self._points, self._classify, self._progress = points, classify, progress
        self._result: Result | None = None

    def result(self) -> Result:
        """Everything but, unless it was found on the way, the interior points."""
        if self._result is None:
            self._result = self._solve(self.params, self._classify)
        return self._result

    def interior(self, alpha: float | str | None = None) -> NDArray[np.bool_]:
        """Which points (n,) lie inside the object; another `alpha` than that of the settings needs a pass."""
        options: dict[str, Any] = {} if alpha is None else {"alpha": alpha}
        params = dataclasses.replace(self.params, **options)
        result = self._result if params == self.params else None
        if result is None or result.interior is None:
            result = self._solve(params, True)
            if params == self.params:
                self._result = result
        assert result.interior is not None  # it was asked for
        return result.interior

    def _solve(self, params: Params, classify: bool) -> Result:
        return estimate_normals(self._points, params, filter_interior=classify, progress=self._progress)
