"""The sides of lines that are given: only signs are turned, by what is known of the points and along sheets."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.graph import couplings, neighbours_around

__all__ = ["checked_trust", "given_lines", "sides_of_lines"]

# Weight of a trusted normal, next to couplings of 1 at most: nothing outweighs it.
TRUST = 1e6
# Weight of what the method found: it speaks as loud as three neighbours (of 1, 3, 8 and 20 the best on bodies with thin
# parts: of exact lines 99.83 % then point outward, against 99.58 % of its own sides).
FOUND = 3.0
# Weight of what the method found where some normals are trusted: less than a coupling, or it would stop them at once.
BESIDE_TRUST = 0.05


def given_lines(normals: ArrayLike, count: int, dimension: int = 3) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
    """Return normals as an (n, d) floating-point array, and the unit lines (n, d) that they lie on.

    Raises
    ------
    ValueError
        Another shape, or a normal that is not finite or of length 0; the message names its row.

    Examples
    --------
    >>> given_lines([[0, 0, 2]], 1)[1]
    array([[0., 0., 1.]])
    """
    array = np.asarray(normals)
    if array.shape != (count, dimension) or array.dtype.kind not in "fiu":
        raise ValueError(
            f"normals must be ({count}, {dimension}) numbers, one for each point, found {array.shape} of {array.dtype}"
        )
    if array.dtype.kind != "f":
        array = array.astype(np.float64)
    lines = array.astype(np.float64)
    # By the largest component first: the square of a tiny normal is 0.
    largest = np.abs(lines).max(axis=1, initial=0.0)
    bad = np.flatnonzero(~(np.isfinite(largest) & (largest > 0)))
    if len(bad):
        raise ValueError(
            f"normals must be finite and not of length 0, found {array[bad[0]].tolist()} in row {bad[0]} "
            f"({len(bad)} such rows)"
        )
    lines /= largest[:, None]
    return array, lines / np.linalg.norm(lines, axis=1, keepdims=True)


def checked_trust(trusted: ArrayLike | None, count: int) -> NDArray[np.bool_] | None:
    """Return which normals (n,) are trusted; None where none is.

    Raises
    ------
    ValueError
        Another shape or type.
    """
    if trusted is None:
        return None
    array = np.asarray(trusted)
    if array.shape != (count,) or array.dtype != np.bool_:
        raise ValueError(f"trusted must hold {count} booleans, found {array.shape} of {array.dtype}")
    return array if array.any() else None


def sides_of_lines(
    around: Neighbourhood,
    rows: NDArray[np.intp],
    lines: NDArray[np.float64],
    evidence: NDArray[np.float64],
    trusted: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Sides of given lines: 1 where one is on its side already, -1 where it is to be turned.

    Parameters
    ----------
    around : Neighbourhood
        Of the m distinct points.
    rows : (n,) intp
        The distinct point that each input point became.
    lines : (n, d) float64
        Unit normals of either sign, in the axes of `around`.
    evidence : (n,) float64
        Positive where a line points to free space, negative where away from it; at most 1 in size.
    trusted : (n,) bool, optional
        Lines that keep their side, whatever the evidence, and hand it on along their sheet.

    Returns
    -------
    (n,) float64

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> lines = ball.normals * np.where(np.arange(500) % 2, 1.0, -1.0)[:, None]
    >>> known = np.where(np.arange(500) == 1, 1.0, 0.0)
    >>> side = sides_of_lines(Neighbourhood(ball.points), np.arange(500), lines, known)
    >>> bool(((lines * side[:, None] * ball.normals).sum(axis=1) > 0).all())
    True
    """
    count = len(around)
    # Of coinciding points one speaks for all, a trusted one where there is one.
    order = np.arange(len(rows))
    if trusted is not None:
        order = np.argsort(~trusted, kind="stable")
    found, first = np.unique(rows[order], return_index=True)
    speaker = order[first]
    assert len(found) == count  # every distinct point came from the input
    line = lines[speaker]
    alike = np.where(np.einsum("nd,nd->n", lines, line[rows]) < 0, -1.0, 1.0)
    weight = np.bincount(rows, alike * evidence, minlength=count).astype(np.float64)
    weight *= FOUND if trusted is None else BESIDE_TRUST
    if trusted is not None:
        weight[rows[trusted]] = TRUST
    edges = neighbours_around(around, line)
    sign = cluster_signs(count, edges, couplings(around.points, line, edges), weight)[rows] * alike
    return sign if trusted is None else np.where(trusted, 1.0, sign)
