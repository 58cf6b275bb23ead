"""Triangles and discs into a depth buffer, in NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Buffer", "draw_discs", "draw_triangles"]

Array = NDArray[Any]

# Candidate pixels handled at once: bounds the memory at some 200 MB.
CHUNK = 2_000_000


class Buffer:
    """The nearest thing under each pixel, what it is, and three numbers about the spot."""

    def __init__(self, pixels: int) -> None:
        self.pixels = pixels
        self.height = np.full(pixels * pixels, -np.inf, dtype=np.float32)
        self.owner = np.full(pixels * pixels, -1, dtype=np.int64)
        self.spot = np.zeros((pixels * pixels, 3), dtype=np.float32)

    def add(self, column: Array, row: Array, height: Array, owner: Array, spot: tuple[Array, ...]) -> None:
        """Keep the fragments that are nearer than what is there."""
        pixel = row.astype(np.int64) * self.pixels + column.astype(np.int64)
        np.maximum.at(self.height, pixel, height)
        won = np.flatnonzero(height == self.height[pixel])
        self.owner[pixel[won]] = owner[won]
        for k, values in enumerate(spot):
            self.spot[pixel[won], k] = values[won]


def _windows(low: Array, high: Array, pixels: int) -> Iterator[tuple[Array, Array, Array]]:
    """Yield (owner, column, row) of all pixels whose centres lie in the windows [low, high], in chunks.

    Columns and rows are float32, of which whole numbers below 2**24 are exact.
    """
    first = np.clip(np.ceil(low - 0.5), 0, pixels).astype(np.int32)
    last = np.clip(np.floor(high - 0.5), -1, pixels - 1).astype(np.int32)
    size = np.maximum(last - first + 1, 0)
    count = size[:, 0].astype(np.int64) * size[:, 1]
    owners = np.flatnonzero(count)
    ends = np.cumsum(count[owners])
    start = 0
    while start < len(owners):
        done = ends[start - 1] if start else 0
        stop = max(int(np.searchsorted(ends, done + CHUNK, side="right")), start + 1)
        part = owners[start:stop]
        owner = np.repeat(part, count[part])
        begin = np.repeat(np.cumsum(count[part]) - count[part], count[part])
        row, column = np.divmod((np.arange(len(owner)) - begin).astype(np.int32), size[owner, 0])
        column, row = column + first[owner, 0], row + first[owner, 1]
        yield owner, column.astype(np.float32), row.astype(np.float32)
        start = stop


def _single(values: Array) -> Array:
    """Return the values in single precision, which halves the traffic."""
    return values.astype(np.float32)


def draw_triangles(buffer: Buffer, corners: Array) -> None:
    """Draw triangles (f, 3, 3) given in pixels; the spot is given in barycentric coordinates."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    u, v = a - c, b - c
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    inverse = 1.0 / np.where(area == 0, 1.0, area)
    # Barycentric coordinates are linear in the distance to corner c; so is the height.
    slopes = np.stack([v[:, 1], -v[:, 0], -u[:, 1], u[:, 0]], axis=1) * inverse[:, None]
    slopes, u, v, c = _single(slopes), _single(u), _single(v), _single(c)
    low, high = corners[:, :, :2].min(axis=1), corners[:, :, :2].max(axis=1)
    high = np.where((area == 0)[:, None], low - 1, high)
    for owner, column, row in _windows(low, high, buffer.pixels):
        x, y = column + 0.5 - c[owner, 0], row + 0.5 - c[owner, 1]
        first = slopes[owner, 0] * x + slopes[owner, 1] * y
        second = slopes[owner, 2] * x + slopes[owner, 3] * y
        # The tolerance closes the seams that rounding leaves between neighbours.
        inside = np.flatnonzero((first >= -1e-4) & (second >= -1e-4) & (first + second <= 1.0001))
        owner, first, second = owner[inside], first[inside], second[inside]
        height = c[owner, 2] + first * u[owner, 2] + second * v[owner, 2]
        buffer.add(column[inside], row[inside], height, owner, (first, second, 1 - first - second))


def draw_discs(buffer: Buffer, centres: Array, normals: Array | None, radius: float) -> None:
    """Draw discs across their normals, or balls where there are none; the spot is given by its normal."""
    low, high = centres[:, :2] - radius, centres[:, :2] + radius
    centres = centres.astype(np.float32)
    facing = np.empty((0, 3), dtype=np.float32)
    if normals is not None:
        # A disc seen edge-on is drawn a pixel wide, not infinitely thin.
        steep = np.copysign(np.maximum(np.abs(normals[:, 2]), 0.1), normals[:, 2])
        slopes = (-normals[:, :2] / steep[:, None]).astype(np.float32)
        facing = normals.astype(np.float32)
    for owner, column, row in _windows(low, high, buffer.pixels):
        x, y = column + 0.5 - centres[owner, 0], centres[owner, 1] - (row + 0.5)
        square = x * x + y * y
        if normals is None:
            inside = np.flatnonzero(square <= radius**2)
            z = np.sqrt(np.maximum(radius**2 - square[inside], 0))
            spot = (x[inside] / radius, y[inside] / radius, z / radius)
            owner = owner[inside]
        else:
            z = slopes[owner, 0] * x + slopes[owner, 1] * y
            inside = np.flatnonzero(square + z * z <= radius**2)
            owner, z = owner[inside], z[inside]
            spot = (facing[owner, 0], facing[owner, 1], facing[owner, 2])
        buffer.add(column[inside], row[inside], centres[owner, 2] + z, owner, spot)
