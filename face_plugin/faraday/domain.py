"""The domain of the Poisson problem: a padded box, and free vertices that grade from the balls to it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import MeshingError
from face_plugin.faraday.balls import Balls
from face_plugin.threads import KDTree

__all__ = ["Box", "Filling", "fill", "padded_box"]

# Cells that the box is cut into along its longest side before refinement.
COARSE_CELLS = 6
# Random displacement of a free vertex, in sizes of its cell: a regular grid is cospherical.
JITTER = 0.15
# Smallest distance of a free vertex to a ball's centre, in local spacings.
CLEARANCE = 0.75
MAXIMUM_DEPTH = 40


@dataclass(frozen=True)
class Box:
    """Axis-aligned box in the canonical frame."""

    lower: NDArray[np.float64]
    """(d,) lower corner; d is 3, or 2 in the plane."""
    upper: NDArray[np.float64]
    """(d,) upper corner."""
    cells: int = COARSE_CELLS
    """Cells that it is cut into along its longest side before refinement."""


@dataclass(frozen=True)
class Filling:
    """Vertices of the domain that belong to no ball."""

    inner: NDArray[np.float64]
    """(p, d) inside the box, outside the balls."""
    outer: NDArray[np.float64]
    """(q, d) on the box, its corners among them."""


def padded_box(balls: Balls, padding: float, least_side: float = 0.25) -> Box:
    """Return the box around the balls, padded by `padding` times its shortest side (paper section 3.1).

    The side counts as no shorter than `least_side` times the longest one: around a flat object the paper's
    pad would vanish, and with it the field outside. 0 is the paper's own pad.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> box = padded_box(build_balls(np.eye(3), np.arange(3)), 0.1)
    >>> bool((box.lower < 0).all() and (box.upper > 1).all())
    True
    """
    lower = (balls.centres - balls.radii[:, None]).min(axis=0)
    upper = (balls.centres + balls.radii[:, None]).max(axis=0)
    side = upper - lower
    pad = padding * max(float(side.min()), least_side * float(side.max()))
    return Box(lower - pad, upper + pad)


def fill(
    balls: Balls,
    spacing: NDArray[np.float64],
    box: Box,
    *,
    grading: float,
    finest: float,
    seed: int,
    most: float = math.inf,
) -> Filling:
    """Place free vertices at the leaf centres of an octree, in the plane a quadtree, that is fine near the balls.

    A cell is refined while its size exceeds ``max(grading * distance to the nearest ball, finest * local spacing)``.

    Parameters
    ----------
    balls : Balls
    spacing : (b,) float64
        Local spacing at each ball.
    box : Box
    grading : float, cell size per distance to the nearest ball
    finest : float, smallest cell size in local spacings
    seed : int
    most : float
        Number of cells that the octree may have.

    Raises
    ------
    MeshingError
        The octree would have more cells than `most`.

    Examples
    --------
    >>> from face_plugin.faraday.balls import build_balls
    >>> balls = build_balls(np.eye(3), np.arange(3))
    >>> filling = fill(balls, np.ones(3), padded_box(balls, 0.1), grading=0.8, finest=1.5, seed=0)
    >>> filling.outer.shape[1]
    3
    """
    tree = KDTree(balls.centres)
    side = box.upper - box.lower
    cells = np.maximum(np.round(side / (side.max() / box.cells)), 1).astype(np.int64)
    cell = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), axis=-1).reshape(-1, len(side))
    inner, outer = [], []
    octants = _corners(len(side))[None]
    rng = np.random.default_rng(seed)
    cells_so_far = 0
    for depth in range(MAXIMUM_DEPTH):
        size = side / (cells << depth)
        centre = box.lower + (cell + 0.5) * size
        distance, nearest = tree.query(centre)
        split = size.max() > np.maximum(grading * distance, finest * spacing[nearest])
        cells_so_far += np.count_nonzero(~split)
        if cells_so_far + octants.shape[1] * np.count_nonzero(split) > most:
            raise MeshingError(
                f"the space between {len(balls.radii)} balls takes more than {most:.0f} free vertices, which is "
                "what the memory allowed holds; try a larger Params.finest, Params.grading or "
                "Params.cage_spacing, Execution.tile_points, or Execution.max_memory"
            )
        leaf, leaf_cell = centre[~split], cell[~split]
        jittered = leaf + rng.uniform(-JITTER, JITTER, leaf.shape) * size
        near, ball = tree.query(jittered)
        inner.append(jittered[near > CLEARANCE * spacing[ball]])
        outer.append(_on_box(leaf_cell, cells << depth, box))
        if not split.any():
            break
        cell = (2 * cell[split][:, None] + octants).reshape(-1, len(side))
    return Filling(np.concatenate(inner), _unique(np.concatenate(outer), side.max()))


def _corners(dimension: int) -> NDArray[np.int64]:
    """Corners (2 ** d, d) of the unit cube."""
    return np.stack(np.meshgrid(*dimension * [[0, 1]], indexing="ij"), axis=-1).reshape(-1, dimension)


def _on_box(cell: NDArray[np.int64], cells: NDArray[np.int64], box: Box) -> NDArray[np.float64]:
    """Corners of the cells that lie on the box, repeated where cells share them."""
    touching = cell[((cell == 0) | (cell == cells - 1)).any(axis=1)]
    corner = (touching[:, None] + _corners(len(cells))).reshape(-1, len(cells))
    corner = np.unique(corner[((corner == 0) | (corner == cells)).any(axis=1)], axis=0)
    # Interpolate so that the box's own planes are hit exactly: a vertex is on the box where a coordinate equals it.
    t = corner / cells
    return np.where(corner == cells, box.upper, box.lower + t * (box.upper - box.lower))


def _unique(points: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Drop repeated points: corners of one place computed at two depths may differ by rounding."""
    _, first = np.unique(np.round(points / (1e-9 * size)).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]
