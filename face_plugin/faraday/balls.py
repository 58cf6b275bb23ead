"""The Faraday cage: a small conducting ball at each point, as a platonic solid (paper section 3.1).

In the plane a ball is a disc, as a regular polygon of as many vertices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from face_plugin.threads import KDTree

__all__ = ["SOLIDS", "Balls", "build_balls"]

Solid = Literal["octahedron", "icosahedron"]


def _icosahedron() -> NDArray[np.float64]:
    golden = (1 + 5**0.5) / 2
    short = [(0.0, a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    vertices = np.array([np.roll(v, k) for k in range(3) for v in short])
    return np.asarray(vertices / np.linalg.norm(vertices[0]))


SOLIDS: dict[str, NDArray[np.float64]] = {
    "octahedron": np.concatenate([np.eye(3), -np.eye(3)]),
    "icosahedron": _icosahedron(),
}


@dataclass(frozen=True)
class Balls:
    """The conductor: disjoint balls in the canonical frame."""

    points: NDArray[np.intp]
    """(b,) row of the cloud's point at the centre of each ball."""
    centres: NDArray[np.float64]
    """(b, d) centres; d is 3, or 2 in the plane."""
    radii: NDArray[np.float64]
    """(b,) radii; no two balls touch."""
    vertices: NDArray[np.float64]
    """(b, s, d) vertices of each ball, on its sphere."""


def build_balls(
    points: NDArray[np.float64],
    rows: NDArray[np.intp],
    *,
    radius: float = 0.45,
    solid: Solid = "octahedron",
    seed: int = 0,
) -> Balls:
    """Put a ball of `radius` times the distance to the nearest other one at each of `points[rows]`.

    Each solid is turned at random, since equal orientations make the Delaunay tetrahedralisation degenerate.

    Parameters
    ----------
    points : (n, d) float64, distinct
    rows : (b,) intp
        Which of the points carry a ball.
    radius : float, fraction of the distance to the nearest other ball's centre
        Below 0.5 the balls are disjoint.
    solid : {"octahedron", "icosahedron"}
        In the plane a polygon of as many vertices: 6 or 12.
    seed : int

    Raises
    ------
    ValueError
        Fewer than two balls: one alone has no neighbour to take its radius from.

    Examples
    --------
    >>> build_balls(np.eye(3), np.arange(3)).vertices.shape
    (3, 6, 3)
    """
    if len(rows) < 2:
        raise ValueError(f"cage_spacing must leave at least 2 balls, found {len(rows)} for {len(points)} points")
    centres = points[rows]
    nearest = KDTree(centres).query(centres, k=2)[0][:, 1]
    radii = radius * nearest
    flat = points.shape[1] == 2
    corners = _polygon(len(SOLIDS[solid])) if flat else SOLIDS[solid]
    turns = (_random_turns if flat else _random_rotations)(len(rows), seed)
    vertices = centres[:, None] + radii[:, None, None] * np.einsum("sj,bij->bsi", corners, turns)
    return Balls(rows, centres, radii, vertices)


def _polygon(count: int) -> NDArray[np.float64]:
    """Vertices (count, 2) of a regular polygon."""
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _random_turns(count: int, seed: int) -> NDArray[np.float64]:
    """(count, 2, 2) rotations of the plane, uniform."""
    angle = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, count)
    x, y = np.cos(angle), np.sin(angle)
    return np.ascontiguousarray(np.array([[x, -y], [y, x]]).transpose(2, 0, 1))


def _random_rotations(count: int, seed: int) -> NDArray[np.float64]:
    """(count, 3, 3) rotations, uniform over SO(3): from unit quaternions."""
    w, x, y, z = np.random.default_rng(seed).normal(size=(4, count))
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    turns = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.ascontiguousarray(turns.transpose(2, 0, 1))
