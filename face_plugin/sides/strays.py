"""Stray points: too far from everything to belong to a surface.

A stray must neither conduct nor block nor vote: its ball grows with the distance to the next point, and a handful of
strays around an object are an outer cage. What tells a stray is that its spacing is many times that of the points
around it; the spacing of a sheet that thins out, such as the far rings of a street scan, changes from one point to the
next by little.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin import cloud
from face_plugin.medians import medians
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.sheets import BULK_NEIGHBOURS, bulk
from face_plugin.threads import KDTree

__all__ = ["find_strays", "without"]

# A stray's spacing is more than this many times the median spacing among its neighbours. At random on one surface the
# largest of 20,000 is 2.2 times as large.
LONELY = 4.0
# The same on a curve, where each has two neighbours and gaps are as long as chance has it.
LONELY_ON_CURVE = 7.0
# Lonely points that form a sheet of their own are no strays: `bulk` among them is below this, for most of those near.
SHEET = 0.12


def find_strays(around: Neighbourhood) -> NDArray[np.bool_]:
    """Which points (n,) are strays.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> points = np.concatenate([sphere(500).points, [[3.0, 0.0, 0.0], [0.0, 2.5, 0.0]]])
    >>> np.flatnonzero(find_strays(Neighbourhood(points)))
    array([500, 501])
    """
    typical = medians(around.spacing, around.neighbour[:, 1:])
    lonely = around.spacing > (LONELY_ON_CURVE if around.plane else LONELY) * typical
    rows = np.flatnonzero(lonely)
    if len(rows) > BULK_NEIGHBOURS:
        # A sparse sheet beside a dense one: its points are lonely there, and near one another.
        among = Neighbourhood(around.points[rows])
        nearest = among.neighbour[:, : BULK_NEIGHBOURS + 1]
        flat = medians(bulk(among.points, among.neighbour), nearest) < SHEET
        lonely[rows[flat & (among.spacing < LONELY * around.spacing[rows])]] = False
    # What is left must have something to be a stray of: not a few points, nor points on a line.
    rest = around.points[~lonely]
    spread = np.linalg.eigvalsh(np.cov(rest.T))[-2] if len(rest) > BULK_NEIGHBOURS else 0.0
    return lonely & (spread > np.finfo(float).eps)


def without(whole: cloud.Cloud, points: ArrayLike, left_out: NDArray[np.bool_]) -> cloud.Cloud:
    """Prepare a cloud anew without some of its points, which become what the nearest of the others are.

    Parameters
    ----------
    whole : Cloud
        Of all points.
    points : (n, 3) array_like
        The input of `whole`.
    left_out : (n,) bool

    Returns
    -------
    Cloud
        `rows` has an entry for every input point.

    Examples
    --------
    >>> points = np.concatenate([np.eye(3), -np.eye(3), [[9.0, 0.0, 0.0]]])
    >>> far = np.arange(7) == 6
    >>> rest = without(cloud.prepare(points), points, far)
    >>> len(rest.points), bool(rest.rows[6] == rest.rows[0])
    (6, True)
    """
    array = cloud.as_points(points, dimensions=cloud.SPACE_OR_PLANE)
    kept = cloud.prepare(array[~left_out])
    rows = np.empty(whole.size, dtype=np.intp)
    rows[~left_out] = kept.rows
    rows[left_out] = KDTree(kept.points).query(kept.frame.to_unit(array[left_out]))[1]
    return dataclasses.replace(kept, rows=rows)
