"""The generators: from one sphere to a teapot with a box left inside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from face_plugin.shapes.shape import Shape, from_solids
from face_plugin.shapes.solids import Solid, arc, ball, block, capsule, cone, dish, egg, mug, ring, shell


def sphere(n: int, seed: int = 0, *, radius: float = 1.0) -> Shape:
    """Sphere about the origin."""
    return from_solids([ball(radius)], n, seed)


def torus(n: int, seed: int = 0, *, major: float = 1.0, minor: float = 0.4) -> Shape:
    """Torus about z: `major` is the radius of its centre line, `minor` that of the tube."""
    return from_solids([ring(major, minor)], n, seed)


def box(n: int, seed: int = 0, *, size: Sequence[float] = (1.0, 0.8, 0.6)) -> Shape:
    """Box with edges `size`."""
    return from_solids([block(size)], n, seed)


def ellipsoid(n: int, seed: int = 0, *, axes: Sequence[float] = (1.0, 0.7, 0.5)) -> Shape:
    """Ellipsoid with half axes `axes`."""
    return from_solids([egg(axes)], n, seed)


def slab(n: int, seed: int = 0, *, thickness: float = 0.05) -> Shape:
    """Square plate of edge 1; it may be thinner than the spacing of the points."""
    return from_solids([block((1.0, 1.0, thickness))], n, seed)


def two_spheres(n: int, seed: int = 0, *, distance: float = 1.2) -> Shape:
    """Two unit spheres whose centres are `distance` apart; with 0 < distance < 2 they cross."""
    return from_solids([ball(1.0), ball(1.0).moved((distance, 0.0, 0.0))], n, seed)


def disjoint_spheres(n: int, seed: int = 0, *, gap: float = 0.5) -> Shape:
    """Two spheres of radius 1 and 0.7 with `gap` between them."""
    return from_solids([ball(1.0), ball(0.7).moved((1.7 + gap, 0.0, 0.0))], n, seed)


def nested_box(n: int, seed: int = 0) -> Shape:
    """Sphere of radius 1 with a turned box inside, all of which is interior."""
    turn = Rotation.from_euler("xyz", [20, 35, 10], degrees=True)
    return from_solids([ball(1.0), block((0.7, 0.5, 0.6)).moved(rotation=turn)], n, seed)


def spherical_shell(n: int, seed: int = 0, *, inner: float = 0.5) -> Shape:
    """Ball of radius 1 around an empty ball of radius `inner`: the cavity's normals point to its centre."""
    return from_solids([shell(inner)], n, seed)


def bowl(n: int, seed: int = 0, *, thickness: float = 0.1) -> Shape:
    """Lower half of a unit ball, hollowed to a wall of `thickness`, open at the top."""
    return from_solids([dish(thickness)], n, seed)


def open_sheet(n: int, seed: int = 0) -> Shape:
    """Lower half of a unit sphere without thickness; the normals are those away from its centre."""
    return from_solids([Solid((arc((0.0, 0.0), 1.0, -np.pi / 2, 0.0),), lambda p: np.ones(len(p)))], n, seed)


def cup(n: int, seed: int = 0, *, depth: float = 3.0, thickness: float = 0.1) -> Shape:
    """Mug without a handle: inner diameter 1, `depth` diameters deep, wall and floor of `thickness`."""
    return from_solids([mug(depth, thickness)], n, seed)


def crossed_cylinders(n: int, seed: int = 0) -> Shape:
    """Two capped cylinders of radius 0.4 and 0.3 and length 2 that cross at a right angle."""
    across = cone(0.3, 0.3, 2.0).moved(rotation=Rotation.from_euler("y", 90, degrees=True))
    return from_solids([cone(0.4, 0.4, 2.0), across], n, seed)


def doubled_shell(n: int, seed: int = 0, *, angle: float = 3.0, pivot: float = 2.0) -> Shape:
    """Two scans of one ellipsoid, the second misregistered by `angle` degrees about z at a distance `pivot`.

    The scans are sampled independently; what of each lies inside the other is interior.
    """
    body = egg((1.0, 0.7, 0.5))
    turn = Rotation.from_euler("z", angle, degrees=True)
    centre = np.array([pivot, 0.0, 0.0])
    return from_solids([body, body.moved(centre - turn.apply(centre), turn)], n, seed, together=False)


def shelves(n: int, seed: int = 0, *, count: int = 5, thickness: float = 0.02) -> Shape:
    """Box of 1.0 x 0.8 x 1.2 with `count` thin plates inside, standing or lying at random (by the seed)."""
    rng = np.random.default_rng(seed)
    size = np.array([1.0, 0.8, 1.2])
    parts = [block(size)]
    for _ in range(count):
        axis = int(rng.integers(3))
        plate = size * rng.uniform(0.6, 0.95, size=3)
        plate[axis] = thickness
        parts.append(block(plate).moved((rng.random(3) - 0.5) * 0.95 * (size - plate)))
    return from_solids(parts, n, seed)


def teapot_solids() -> list[Solid]:
    """Body, handle, spout, lid, knob and four legs; all of them reach into the body."""
    degrees = {"degrees": True}
    parts = [
        egg((1.0, 0.9, 0.75)),
        ring(0.48, 0.11).moved((-0.95, 0.0, 0.1), Rotation.from_euler("x", 90, **degrees)),
        cone(0.3, 0.12, 1.3).moved((1.05, 0.0, 0.3), Rotation.from_euler("y", 50, **degrees)),
        egg((0.5, 0.5, 0.14)).moved((0.0, 0.0, 0.68)),
        ball(0.15).moved((0.0, 0.0, 0.9)),
    ]
    for turn in (45, 135, 225, 315):
        tilt = Rotation.from_euler("zy", [0, -25], **degrees)
        leg = capsule(0.13, 0.9).moved((0.5, 0.0, -0.65), tilt)
        parts.append(leg.moved(rotation=Rotation.from_euler("z", turn, **degrees)))
    return parts


def teapot(n: int, seed: int = 0) -> Shape:
    """Teapot of overlapping parts: body, handle, spout, lid, knob and four legs that cross into the body."""
    return from_solids(teapot_solids(), n, seed)


def demo_shape(n: int, seed: int = 0) -> Shape:
    """Teapot with a box left inside: intersecting parts, and something that must not reach the surface."""
    turn = Rotation.from_euler("xyz", [15, 25, 40], degrees=True)
    inside = block((0.6, 0.45, 0.35)).moved((0.0, 0.05, 0.1), turn)
    return from_solids([*teapot_solids(), inside], n, seed)
