"""Plane sections: which plane to look at, the points near it, and what a mesh leaves on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.app.plot.render import Up

__all__ = ["Section"]

Array = NDArray[Any]


@dataclass(frozen=True)
class Section:
    """A plane across one coordinate axis.

    Examples
    --------
    >>> import numpy as np
    >>> Section.through(np.diag([1.0, 2.0, 3.0]), up="z").axis
    0
    """

    axis: int
    """Coordinate that is constant on the plane."""
    at: float
    """Its value."""
    across: int
    """Coordinate that runs to the right in a picture of the plane."""
    upward: int
    """Coordinate that runs upward."""

    @classmethod
    def through(cls, points: Array, *, up: Up = "z", axis: Up | None = None, at: float | None = None) -> Section:
        """Cut across `axis`, by default the object's shortest, in the middle of the points."""
        low, high = points.min(axis=0), points.max(axis=0)
        k = "xyz".index(axis) if axis is not None else int(np.argmin(high - low))
        upward = "xyz".index(up)
        if upward == k:
            upward = (k + 2) % 3
        return cls(k, float(0.5 * (low[k] + high[k])) if at is None else float(at), 3 - k - upward, upward)

    @property
    def normal(self) -> Array:
        """Direction towards a viewer who sees `across` run to the right and `upward` upward."""
        return np.asarray(np.cross(np.eye(3)[self.across], np.eye(3)[self.upward]))

    @property
    def labels(self) -> tuple[str, str, str]:
        """Names of the coordinates: to the right, upward, and constant."""
        return "xyz"[self.across], "xyz"[self.upward], "xyz"[self.axis]

    def near(self, points: Array, distance: float) -> NDArray[np.bool_]:
        """Tell which points lie within `distance` of the plane."""
        return np.asarray(np.abs(points[:, self.axis] - self.at) <= distance)

    def flatten(self, points: Array) -> Array:
        """Return the (k, 2) coordinates in the plane."""
        return points[:, [self.across, self.upward]]

    def grid(self, points: Array, pixels: int, margin: float = 0.12) -> tuple[Array, tuple[float, float, float, float]]:
        """Return (rows, columns, 3) positions that cover the points, and (left, right, bottom, top)."""
        flat = self.flatten(points)
        low, high = flat.min(axis=0), flat.max(axis=0)
        size = float((high - low).max())
        low, high = low - margin * size, high + margin * size
        count = np.maximum(np.round((high - low) / (high - low).max() * pixels).astype(int), 2)
        positions = np.full((count[1], count[0], 3), self.at, dtype=np.float64)
        positions[..., self.across] = np.linspace(low[0], high[0], count[0])[None, :]
        positions[..., self.upward] = np.linspace(low[1], high[1], count[1])[:, None]
        return positions, (float(low[0]), float(high[0]), float(low[1]), float(high[1]))

    def outline(self, vertices: Array, faces: Array) -> Array:
        """Return (s, 2, 2): the line segments in which a mesh meets the plane."""
        side = vertices[:, self.axis] - self.at
        # A vertex on the plane counts as beyond it: every face then crosses on two edges or on none.
        above = side >= 0
        mixed = faces[above[faces].any(axis=1) & ~above[faces].all(axis=1)]
        flat = self.flatten(vertices)
        start, end = mixed, np.roll(mixed, -1, axis=1)
        crossing = above[start] != above[end]
        gap = np.where(crossing, side[start] - side[end], 1.0)
        along = (side[start] / gap)[..., None]
        spots = flat[start] * (1 - along) + flat[end] * along
        return np.asarray(spots[crossing].reshape(-1, 2, 2))

    def behind(self, vertices: Array, faces: Array) -> tuple[Array, Array]:
        """Return the vertices and faces of the part of a mesh behind the plane, as `normal` sees it."""
        height = self.normal[self.axis] * (vertices[:, self.axis] - self.at)
        front = height > 0
        whole = faces[~front[faces].any(axis=1)]
        # Faces across the plane: vertices in front move along their edges onto it.
        pieces, places = [whole], [vertices]
        count = len(vertices)
        for number in (1, 2):
            cut = faces[front[faces].sum(axis=1) == number]
            # Turn each face so that its odd vertex comes first; the order around stays.
            odd = np.argmax(front[cut] == (number == 1), axis=1)
            a, b, c = (cut[np.arange(len(cut)), (odd + k) % 3] for k in range(3))
            ab, ac = (_cross(vertices, height, a, other) for other in (b, c))
            first, second = count + np.arange(len(cut)), count + len(cut) + np.arange(len(cut))
            places += [ab, ac]
            count += 2 * len(cut)
            if number == 1:
                pieces += [np.stack([first, b, c], axis=1), np.stack([first, c, second], axis=1)]
            else:
                pieces.append(np.stack([a, first, second], axis=1))
        return np.concatenate(places), np.concatenate(pieces)


def _cross(vertices: Array, height: Array, start: Array, end: Array) -> Array:
    along = (height[start] / (height[start] - height[end]))[:, None]
    return np.asarray(vertices[start] * (1 - along) + vertices[end] * along)
