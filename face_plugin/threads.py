"""Work on all cores that may be interrupted, and the search for nearest points as such work."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.memory import usable_cores

__all__ = ["KDTree", "in_threads", "one_core"]

_alone: list[bool] = [False]


def one_core() -> None:
    """Use no more than one core from now on: as many other processes as there are cores do the same."""
    _alone[0] = True


def in_threads(run: Callable[[slice], None], count: int, least: int = 512) -> None:
    """Call ``run(slice)`` for pieces of `count` rows on all cores; a row is computed alone, so any split is equal.

    A core gets at least `least` rows.
    """
    pieces = 1 if _alone[0] else min(usable_cores(), count // least)
    if pieces <= 1:
        run(slice(0, count))
        return
    bounds = np.linspace(0, count, 4 * pieces + 1).astype(int)
    slices = [slice(a, b) for a, b in itertools.pairwise(bounds)]
    with ThreadPoolExecutor(pieces) as pool:
        list(pool.map(run, slices))


class KDTree(cKDTree):  # type: ignore[misc]
    """SciPy's tree, whose searches on all cores may be interrupted.

    The threads of SciPy's own, `workers`, outlive a search that Ctrl-C ends, and go on reading and writing memory that
    is free again, which ends the process by a signal.
    """

    def query(
        self, x: NDArray[np.floating], k: int | list[int] = 1, bound: float = np.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Distances and rows of the nearest points, as of SciPy.

        Parameters
        ----------
        x : (m, 3) float64
        k : int or list of int
            How many, or which of them counted from 1.
        bound : float
            Points as far away or farther do not count: where there are fewer, distances are infinite.

        Returns
        -------
        distance, row : (m,) for k=1, else (m, k)

        Examples
        --------
        >>> KDTree(np.eye(3)).query(np.eye(3), k=[1])[1].ravel()
        array([0, 1, 2])
        """
        shape = (len(x),) if k == 1 else (len(x), k if isinstance(k, int) else len(k))
        distance, row = np.empty(shape), np.empty(shape, dtype=np.intp)

        def run(rows: slice) -> None:
            distance[rows], row[rows] = cKDTree.query(self, x[rows], k=k, distance_upper_bound=bound)

        in_threads(run, len(x))
        return distance, row

    def within(self, x: NDArray[np.float64], r: NDArray[np.float64]) -> NDArray[Any]:
        """Return lists (m,) of the rows within distances r (m,) of positions x (m, 3).

        Examples
        --------
        >>> KDTree(np.eye(3)).within(np.zeros((1, 3)), np.ones(1))[0]
        [0, 1, 2]
        """
        lists = np.empty(len(x), dtype=object)

        def run(rows: slice) -> None:
            lists[rows] = cKDTree.query_ball_point(self, x[rows], r[rows])

        in_threads(run, len(x))
        return lists
