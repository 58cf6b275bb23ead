"""Even points on the ribbons, and normals carried back from the points to the ribbons' vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.ribbons.sketch import Sketch
from face_plugin.shapes.sampling import OVERSAMPLING, apart, evenly

DEFAULT_COUNT = 10_000


@dataclass(frozen=True)
class Samples:
    """Points on the ribbons of a sketch.

    Attributes
    ----------
    points
        (n, 3) float64, in the sketch's unit.
    faces
        (n,) int64: the face that a point lies in.
    barycentric
        (n, 3) float64: its coordinates there, which sum to 1.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    barycentric: NDArray[np.float64]


def sample(sketch: Sketch, n: int | None = None, *, spacing: float | None = None, seed: int = 0) -> Samples:
    """Spread points evenly over the ribbons (Poisson disk over their area).

    Distances are those in space: where ribbons overlap the points are no denser than elsewhere.

    Parameters
    ----------
    sketch
        One or more ribbons.
    n
        Number of points, 1 or more; 10,000 if neither this nor `spacing` is given.
    spacing
        Smallest distance between two points instead, in the sketch's unit.
    seed
        Of the random numbers: the same seed gives the same points.

    Returns
    -------
    Samples

    Raises
    ------
    ValueError
        Both `n` and `spacing` are given, or one is not positive.

    Examples
    --------
    >>> from face_plugin.ribbons import teapot_sketch
    >>> sample(teapot_sketch(), 2000).points.shape
    (2000, 3)
    """
    if n is not None and spacing is not None:
        raise ValueError("n and spacing: found both, allowed is one of them")
    if n is not None and n < 1:
        raise ValueError(f"n: found {n}, allowed is 1 or more")
    if spacing is not None and not (np.isfinite(spacing) and spacing > 0):
        raise ValueError(f"spacing: found {spacing}, allowed is a positive number")
    rng = np.random.default_rng(seed)
    areas = sketch.areas
    if spacing is not None:
        # Disks at this distance hold 0.7 / spacing^2 points a unit of area.
        target = max(0.7 * float(areas.sum()) / spacing**2, 1.0)
        if target > 1e7:
            raise ValueError(f"spacing: found {spacing}, which asks for {target:.2g} points; allowed are 1e7")
    else:
        target = float(n or DEFAULT_COUNT)
    count = round(OVERSAMPLING * target)
    # Systematic in the cumulated area, so that no face is left out by chance.
    at = (np.arange(count) + rng.random(count)) / count
    bounds = np.cumsum(areas)
    faces = np.minimum(np.searchsorted(bounds, at * bounds[-1], side="right"), len(areas) - 1)
    root, along = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.column_stack([1.0 - root, root * (1.0 - along), root * along])
    points = np.einsum("nk,nki->ni", weights, sketch.vertices[sketch.faces[faces]])
    kept = apart(points, spacing, rng) if spacing is not None else evenly(points, round(target), rng)
    return Samples(points[kept], faces[kept], weights[kept])


def normals_at_vertices(sketch: Sketch, samples: Samples, normals: NDArray[np.floating]) -> NDArray[np.float64]:
    """Carry normals from the samples to the vertices of the ribbons.

    A vertex takes the mean of the samples in its faces, weighted by their barycentric coordinates there. The
    three vertices of a SurfaceBrush station share one normal, as they do in its files. A vertex without a
    sample takes the normal of the nearest sample on its stroke, or of all where the stroke has none.

    Parameters
    ----------
    sketch
        What was sampled.
    samples
        As returned by `sample`.
    normals
        (n, 3) unit normals of the samples.

    Returns
    -------
    (m, 3) float64 unit normals.

    Raises
    ------
    ValueError
        There is not one normal a sample.

    Examples
    --------
    >>> import numpy as np
    >>> from face_plugin.ribbons import teapot_sketch
    >>> sketch = teapot_sketch()
    >>> samples = sample(sketch, 500)
    >>> up = np.tile([0.0, 0.0, 1.0], (500, 1))
    >>> bool(np.allclose(normals_at_vertices(sketch, samples, up), [0, 0, 1]))
    True
    """
    if normals.shape != samples.points.shape:
        raise ValueError(f"normals: found shape {normals.shape}, allowed is {samples.points.shape}")
    count = len(sketch.vertices)
    group = np.arange(count) if sketch.stations is None else sketch.stations
    corners = group[sketch.faces[samples.faces]]
    sums = np.zeros((int(group.max()) + 1, 3))
    for k in range(3):
        np.add.at(sums, corners[:, k], samples.barycentric[:, k, None] * normals)
    # Samples of two sides cancel out: there, too, the nearest decides.
    empty = np.linalg.norm(sums, axis=1) < 1e-6
    first = np.unique(group, return_index=True)[1]
    place = np.where(np.isfinite(sketch.vertices[first]), sketch.vertices[first], 0.0)
    owner, stroke = sketch.vertex_strokes[first], sketch.strokes[samples.faces]
    for k in np.unique(owner[empty]):
        rows = np.flatnonzero(empty & (owner == k))
        own = np.flatnonzero(stroke == k)
        if not len(own):
            own = np.arange(len(stroke))
        sums[rows] = normals[own[cKDTree(samples.points[own]).query(place[rows])[1]]]
    out = sums[group]
    unit: NDArray[np.float64] = out / np.linalg.norm(out, axis=1, keepdims=True)
    return unit
