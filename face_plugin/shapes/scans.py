"""Scans of boxes: rays from where a sensor stands to what they meet first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Scan", "camera_rays", "ring_rays", "scan_boxes", "sphere_rays"]

Array = NDArray[np.float64]
Box = tuple[Sequence[float], Sequence[float]]
"""Lower and upper corner, in metres; its faces are seen from outside and from inside."""

# Turns between consecutive points of a Fibonacci spiral: (3 - sqrt 5) / 2, which never repeats.
GOLDEN = (3.0 - 5.0**0.5) / 2.0


@dataclass(frozen=True)
class Scan:
    """A scan and what is true of it."""

    points: Array
    """(n, 3)."""
    normals: Array
    """(n, 3) true unit normals; they face the free space that was scanned."""
    viewpoints: Array | None = None
    """(k, 3) where the sensor stood; None where that says nothing."""
    up: Array | None = None
    """(3,) direction from which all was seen, from afar; None where there is none."""

    def __len__(self) -> int:
        return len(self.points)


def sphere_rays(count: int) -> Array:
    """Directions (count, 3) spread evenly over the sphere: of a scanner that turns all round.

    Examples
    --------
    >>> bool(np.abs(sphere_rays(1000).mean(axis=0)).max() < 0.01)
    True
    """
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = 2.0 * np.pi * GOLDEN * np.arange(count)
    arm = np.sqrt(1.0 - height**2)
    return np.column_stack([arm * np.cos(turn), arm * np.sin(turn), height])


def ring_rays(rings: int, per_ring: int, lowest: float = -25.0, highest: float = 15.0) -> Array:
    """Directions (rings * per_ring, 3) on cones about z, `lowest` to `highest` in degrees: of a spinning sensor.

    Examples
    --------
    >>> ring_rays(16, 100).shape
    (1600, 3)
    """
    rise, turn = np.meshgrid(
        np.radians(np.linspace(lowest, highest, rings)), 2.0 * np.pi * np.arange(per_ring) / per_ring, indexing="ij"
    )
    rays = np.stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)], axis=-1)
    return np.asarray(rays.reshape(-1, 3))


def camera_rays(width: int, height: int, forward: ArrayLike, field: float = 60.0) -> Array:
    """Directions (width * height, 3) of a camera's pixels; `field` is its horizontal angle in degrees.

    Parameters
    ----------
    width, height : int
        Pixels.
    forward : (3,) array_like
        Where it looks; not straight up or down.
    field : float

    Examples
    --------
    >>> camera_rays(4, 3, [1.0, 0.0, 0.0]).shape
    (12, 3)
    """
    ahead = np.asarray(forward, dtype=np.float64)
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    above = np.cross(right, ahead)
    wide = np.tan(np.radians(field) / 2.0)
    x, y = np.meshgrid(np.linspace(-wide, wide, width), np.linspace(-wide, wide, height) * height / width)
    rays = (ahead + x[..., None] * right + y[..., None] * above).reshape(-1, 3)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def scan_boxes(
    boxes: Sequence[Box],
    viewpoints: ArrayLike,
    rays: Array,
    n: int,
    rng: np.random.Generator,
    *,
    noise: float = 0.0,
    reach: float = np.inf,
) -> Scan:
    """Scan boxes from each viewpoint along the same rays.

    Parameters
    ----------
    boxes : sequence of (lower, upper)
        At least one.
    viewpoints : (k, 3) array_like
        Not on a face.
    rays : (r, 3) float64
        Unit directions.
    n : int
        How many of the hits to keep.
    rng : numpy.random.Generator
        Of the noise, and of which hits are kept: every so many of a spiral would be streaks.
    noise : float
        Standard deviation along the ray.
    reach : float
        Farthest distance that is measured.

    Raises
    ------
    ValueError
        Fewer than `n` rays hit anything.

    Examples
    --------
    >>> cube = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    >>> inside = scan_boxes([cube], [[0.5, 0.5, 0.5]], sphere_rays(500), 400, np.random.default_rng(0))
    >>> bool(((0.5 - inside.points) * inside.normals).sum(axis=1).min() > 0)
    True
    """
    views = np.asarray(viewpoints, dtype=np.float64)
    hits = [_first_hits(boxes, view, rays) for view in views]
    distance = np.concatenate([hit[0] for hit in hits])
    normals = np.concatenate([hit[1] for hit in hits])
    start, direction = np.repeat(views, len(rays), axis=0), np.tile(rays, (len(views), 1))
    met = np.flatnonzero(distance < reach)
    if len(met) < n:
        raise ValueError(f"n: found {n}, allowed is at most the {len(met)} rays that hit something")
    kept = np.sort(rng.choice(met, n, replace=False))
    measured = distance[kept] + noise * rng.normal(size=n)
    return Scan(start[kept] + measured[:, None] * direction[kept], normals[kept], views)


def _first_hits(boxes: Sequence[Box], view: Array, rays: Array) -> tuple[Array, Array]:
    """Find the distance (r,) to the first face that each ray meets, infinite if none, and that face's normal (r, 3)."""
    nearest = np.full(len(rays), np.inf)
    normals = np.zeros_like(rays)
    everywhere = np.arange(len(rays))
    with np.errstate(divide="ignore", invalid="ignore"):
        for lower, upper in boxes:
            one, other = (np.asarray(lower) - view) / rays, (np.asarray(upper) - view) / rays
            into, out_of = np.fmin(one, other), np.fmax(one, other)
            enters, leaves = into.max(axis=1), out_of.min(axis=1)
            inside = enters <= 0.0
            distance = np.where(inside, leaves, enters)
            axis = np.where(inside, out_of.argmin(axis=1), into.argmax(axis=1))
            nearer = (enters <= leaves) & (distance > 0.0) & (distance < nearest)
            nearest[nearer] = distance[nearer]
            facing = np.zeros_like(rays)
            facing[everywhere, axis] = -np.sign(rays[everywhere, axis])
            normals[nearer] = facing[nearer]
    return nearest, normals
