"""Solids that can be sampled uniformly on their surface and asked what is inside."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Sampler = Callable[[int, np.random.Generator], tuple[Array, Array]]
Level = Callable[[Array], Array]

_TABLE = 4097


@dataclass(frozen=True)
class Patch:
    """A piece of surface: its area and a uniform sampler returning points and outward unit normals."""

    area: float
    sample: Sampler


@dataclass(frozen=True)
class Solid:
    """Patches that bound a body, and `level`: negative inside, zero on the surface, positive outside."""

    patches: tuple[Patch, ...]
    level: Level

    @property
    def area(self) -> float:
        """Area of the whole boundary."""
        return sum(patch.area for patch in self.patches)

    def sample(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw `count` points uniformly by area, with their outward unit normals."""
        shares = np.array([patch.area for patch in self.patches])
        quota = np.diff(np.rint(np.cumsum(shares) / shares.sum() * count).astype(int), prepend=0)
        drawn = [patch.sample(int(k), rng) for patch, k in zip(self.patches, quota, strict=True)]
        return np.concatenate([p for p, _ in drawn]), np.concatenate([v for _, v in drawn])

    def moved(self, shift: ArrayLike = (0.0, 0.0, 0.0), rotation: Rotation | None = None) -> Solid:
        """Return the solid turned about the origin, then shifted."""
        turn = (rotation or Rotation.identity()).as_matrix()
        offset = np.asarray(shift, dtype=np.float64)

        def place(sample: Sampler) -> Sampler:
            def placed(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
                points, normals = sample(count, rng)
                return points @ turn.T + offset, normals @ turn.T

            return placed

        patches = tuple(Patch(patch.area, place(patch.sample)) for patch in self.patches)
        return Solid(patches, lambda p: self.level((p - offset) @ turn))


def _revolve(radius: Array, height: Array, normal: Array) -> Patch:
    """Surface of revolution about z of a tabulated curve (radius, height) with in-plane normals (k, 2)."""
    step = np.hypot(np.diff(radius), np.diff(height))
    weight = np.concatenate([[0.0], np.cumsum(step * 0.5 * (radius[1:] + radius[:-1]))])
    t = np.arange(len(radius), dtype=np.float64)

    def sample(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        at = np.interp(rng.random(count) * weight[-1], weight, t)
        angle = rng.random(count) * 2.0 * np.pi
        around = np.column_stack([np.cos(angle), np.sin(angle)])
        r, z = np.interp(at, t, radius), np.interp(at, t, height)
        nr, nz = np.interp(at, t, normal[:, 0]), np.interp(at, t, normal[:, 1])
        return np.column_stack([r[:, None] * around, z]), np.column_stack([nr[:, None] * around, nz])

    return Patch(float(2.0 * np.pi * weight[-1]), sample)


def line(start: tuple[float, float], end: tuple[float, float]) -> Patch:
    """Disk, cylinder or cone: the segment (radius, height) turned about z, outside on its right hand."""
    t = np.linspace(0.0, 1.0, _TABLE)
    direction = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
    normal = np.tile([direction[1], -direction[0]], (_TABLE, 1))
    return _revolve(start[0] + t * (end[0] - start[0]), start[1] + t * (end[1] - start[1]), normal)


def arc(centre: tuple[float, float], radius: float, start: float, end: float, *, hollow: bool = False) -> Patch:
    """Part of a sphere or torus: a circle's arc in (radius, height), angles in radians, turned about z."""
    phi = np.linspace(start, end, _TABLE)
    outward = np.column_stack([np.cos(phi), np.sin(phi)])
    patch = _revolve(centre[0] + radius * outward[:, 0], centre[1] + radius * outward[:, 1], outward)

    def sample(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        points, normals = patch.sample(count, rng)
        # The table's chords lie a hair inside the arc: put the points exactly on it.
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        around = points[:, :2] / np.maximum(np.linalg.norm(points[:, :2], axis=1, keepdims=True), 1e-300)
        points = np.column_stack([centre[0] * around, np.full(count, centre[1])]) + radius * normals
        return points, -normals if hollow else normals

    return Patch(patch.area, sample)


def ball(radius: float) -> Solid:
    """Sphere of the given radius about the origin."""
    surface = arc((0.0, 0.0), radius, -np.pi / 2, np.pi / 2)
    return Solid((surface,), lambda p: np.linalg.norm(p, axis=1) - radius)


def ring(major: float, minor: float) -> Solid:
    """Torus about z."""
    surface = arc((major, 0.0), minor, 0.0, 2.0 * np.pi)
    return Solid((surface,), lambda p: np.hypot(np.hypot(p[:, 0], p[:, 1]) - major, p[:, 2]) - minor)


def cone(bottom: float, top: float, height: float) -> Solid:
    """Frustum about z between the radii `bottom` and `top`, centred; a cylinder where they are equal."""
    h = height / 2

    def level(p: Array) -> Array:
        side = bottom + (top - bottom) * (p[:, 2] + h) / height
        return np.maximum(np.hypot(p[:, 0], p[:, 1]) - side, np.abs(p[:, 2]) - h)

    patches = (line((0.0, -h), (bottom, -h)), line((bottom, -h), (top, h)), line((top, h), (0.0, h)))
    return Solid(patches, level)


def capsule(radius: float, length: float) -> Solid:
    """Cylinder of `length` about z with half balls at its ends."""
    h = length / 2
    patches = (
        arc((0.0, -h), radius, -np.pi / 2, 0.0),
        line((radius, -h), (radius, h)),
        arc((0.0, h), radius, 0.0, np.pi / 2),
    )

    def level(p: Array) -> Array:
        beyond = p[:, 2] - np.clip(p[:, 2], -h, h)
        return np.hypot(np.hypot(p[:, 0], p[:, 1]), beyond) - radius

    return Solid(patches, level)


def block(size: ArrayLike) -> Solid:
    """Box with the given edge lengths, centred at the origin."""
    half = np.asarray(size, dtype=np.float64) / 2

    def face(axis: int, side: float) -> Patch:
        def sample(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
            points = (2.0 * rng.random((count, 3)) - 1.0) * half
            points[:, axis] = side * half[axis]
            normals = np.zeros((count, 3))
            normals[:, axis] = side
            return points, normals

        return Patch(float(4.0 * half.prod() / half[axis]), sample)

    patches = tuple(face(axis, side) for axis in range(3) for side in (-1.0, 1.0))
    return Solid(patches, lambda p: (np.abs(p) - half).max(axis=1))


def egg(axes: ArrayLike) -> Solid:
    """Ellipsoid with the given half axes; its `level` has the right sign but is not a distance."""
    scale = np.asarray(axes, dtype=np.float64)
    # A patch of the unit sphere with normal v grows by det(A) |A^-1 v|.
    step = (np.arange(400) + 0.5) / 200
    z, angle = (a.ravel() for a in np.meshgrid(step - 1, step * np.pi))
    grid = np.column_stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])
    area = float(4.0 * np.pi * scale.prod() * np.linalg.norm(grid / scale, axis=1).mean())

    def sample(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        found = np.empty((0, 3))
        while len(found) < count:
            unit = rng.standard_normal((2 * count + 16, 3))
            unit /= np.linalg.norm(unit, axis=1, keepdims=True)
            growth = np.linalg.norm(unit / scale, axis=1) * scale.min()
            found = np.concatenate([found, unit[rng.random(len(unit)) < growth]])
        unit = found[:count]
        normals = unit / scale
        return unit * scale, normals / np.linalg.norm(normals, axis=1, keepdims=True)

    return Solid((Patch(area, sample),), lambda p: np.linalg.norm(p / scale, axis=1) - 1.0)


def shell(inner: float) -> Solid:
    """Ball of radius 1 with an empty ball of radius `inner` at its centre."""
    hollow = arc((0.0, 0.0), inner, -np.pi / 2, np.pi / 2, hollow=True)

    def level(p: Array) -> Array:
        r: Array = np.linalg.norm(p, axis=1)
        return np.maximum(r - 1.0, inner - r)

    return Solid((*ball(1.0).patches, hollow), level)


def dish(thickness: float) -> Solid:
    """Lower half of a `shell` with a wall of `thickness`."""
    inner = 1.0 - thickness
    patches = (
        arc((0.0, 0.0), 1.0, -np.pi / 2, 0.0),
        line((1.0, 0.0), (inner, 0.0)),
        arc((0.0, 0.0), inner, -np.pi / 2, 0.0, hollow=True),
    )
    whole = shell(inner)
    return Solid(patches, lambda p: np.maximum(whole.level(p), p[:, 2]))


def mug(depth: float, thickness: float) -> Solid:
    """Cylinder of inner radius 0.5, open at the top, with its floor at z = 0 and a wall of `thickness`."""
    inner, outer = 0.5, 0.5 + thickness
    outside = [(0.0, -thickness), (outer, -thickness), (outer, depth)]
    profile = [*outside, (inner, depth), (inner, 0.0), (0.0, 0.0)]

    def level(p: Array) -> Array:
        r, z = np.hypot(p[:, 0], p[:, 1]), p[:, 2]
        hull = np.maximum(r - outer, np.maximum(z - depth, -thickness - z))
        return np.maximum(hull, -np.maximum(r - inner, -z))

    return Solid(tuple(line(a, b) for a, b in pairwise(profile)), level)
