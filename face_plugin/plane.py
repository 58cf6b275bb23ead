"""Points in the plane: which of the arguments and steps serve them, and what is said of the others."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["refuse_in_plane"]


def refuse_in_plane(points: Any, **given: Any) -> None:
    """Raise where points lie in the plane and something is given that only points in space have.

    Parameters
    ----------
    points : array_like
    **given
        By name; what is None or False is not given.

    Raises
    ------
    ValueError
        Points of shape (n, 2), and something is given.

    Examples
    --------
    >>> refuse_in_plane(np.zeros((5, 3)), viewpoints=[[0.0, 0.0, 1.0]])
    >>> refuse_in_plane(np.zeros((5, 2)), viewpoints=None)
    >>> refuse_in_plane(np.zeros((5, 2)), up=[0.0, 1.0])
    Traceback (most recent call last):
    ValueError: up serves points in space, of shape (n, 3), found points of shape (5, 2): leave it out in the plane
    """
    named = [name for name, value in given.items() if value is not None and value is not False]
    shape: tuple[int, ...] = np.shape(points) if named else ()
    if len(shape) == 2 and shape[1] == 2:
        raise ValueError(
            f"{named[0]} serves points in space, of shape (n, 3), "
            f"found points of shape {shape}: leave it out in the plane"
        )
