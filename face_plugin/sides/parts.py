"""Connected parts of a surface, and what is known of each: whether it is open, and what tells its side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from face_plugin.faraday.gradient import ROUNDING, FieldAtPoints
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.graph import couplings, neighbours_around
from face_plugin.sides.vantage import FEWEST, is_open

__all__ = ["open_parts", "parts"]

# Neighbours farther apart than this many spacings are not of one part: scan lines are, seven times as far apart as the
# points along them.
REACH = 8.0
# Nor those whose coupling is weaker than this: one stands over the other. Across a right angle it is 0.2 to 0.5.
COUPLED = 0.2


def parts(around: Neighbourhood, normals: NDArray[np.float64]) -> NDArray[np.intp]:
    """Find the connected part that each point (n,) belongs to; parts are numbered from 0.

    Parameters
    ----------
    around : Neighbourhood
        Of n points.
    normals : (n, 3) float64

    Examples
    --------
    >>> from face_plugin.shapes import disjoint_spheres
    >>> balls = disjoint_spheres(1000)
    >>> int(parts(Neighbourhood(balls.points), balls.normals).max()) + 1
    2
    """
    edges = neighbours_around(around, normals)
    length = np.linalg.norm(around.points[edges.first] - around.points[edges.second], axis=1)
    near = length < REACH * np.maximum(around.spacing[edges.first], around.spacing[edges.second])
    joined = near & (np.abs(couplings(around.points, normals, edges)) > COUPLED)
    ends = (edges.first[joined], edges.second[joined])
    link = coo_matrix((np.ones(len(ends[0])), ends), shape=(len(around), len(around)))
    return np.asarray(connected_components(link, directed=False)[1], dtype=np.intp)


def open_parts(part: NDArray[np.intp], field: FieldAtPoints) -> NDArray[np.bool_]:
    """Whether the part (n,) of each point encloses nothing: the field is alike on both of its sides.

    Parts of too few points to tell are as the whole cloud is. Those where no field gets lie inside others; they enclose
    something.

    Parameters
    ----------
    part : (n,) intp
        As `parts` has it.
    field : FieldAtPoints
        What the field says of the points.

    Examples
    --------
    >>> part = np.repeat([0, 1, 2], [200, 200, 5])
    >>> difference = np.repeat([1.0, 0.5, 1.0], [200, 200, 5])
    >>> opened = open_parts(part, FieldAtPoints(np.ones(405), np.zeros((405, 3)), difference))
    >>> opened[[0, 200, 400]]
    array([False,  True,  True])
    """
    # In the dark the difference is rounding.
    difference = np.where(field.strength > ROUNDING, field.difference, 1.0)
    count = np.bincount(part)
    opened = np.full(len(count), is_open(difference))
    for large in np.flatnonzero(count > FEWEST):
        opened[large] = is_open(difference[part == large])
    return opened[part]
