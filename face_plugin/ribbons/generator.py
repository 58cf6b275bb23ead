"""A generated ribbon sketch, so that tests and examples need no third party's drawings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from face_plugin.ribbons.sketch import Sketch
from face_plugin.ribbons.strokes import Stroke, ribbons
from face_plugin.shapes.solids import Solid, capsule, egg, ring

_BODY = np.array([1.0, 0.9, 0.75])
_HANDLE = (0.45, 0.13)
_HANDLE_AT = np.array([-0.95, 0.0, 0.1])
_HANDLE_TURN = Rotation.from_euler("x", 90, degrees=True)
_LIMB_STEPS = 24


def _limbs() -> list[tuple[float, float, NDArray[np.float64], Rotation]]:
    """Spout and four legs as capsules: radius, length, place and turn. All begin well inside the body."""
    spout = (0.16, 1.2, np.array([1.0, 0.0, 0.3]), Rotation.from_euler("y", 50, degrees=True))
    legs = []
    for angle in (45, 135, 225, 315):
        about = Rotation.from_euler("z", angle, degrees=True)
        tilt = Rotation.from_euler("y", 155, degrees=True)
        legs.append((0.15, 0.8, about.apply([0.5, 0.0, -0.65]), about * tilt))
    return [spout, *legs]


def teapot_solids() -> list[Solid]:
    """Solids whose surfaces the strokes of `teapot_sketch` follow: body, handle, spout and legs."""
    parts = [egg(_BODY), ring(*_HANDLE).moved(_HANDLE_AT, _HANDLE_TURN)]
    return parts + [capsule(radius, length).moved(place, turn) for radius, length, place, turn in _limbs()]


def teapot_sketch(*, gap: float = 0.1, overlap: float = 0.3, tremor: float = 0.005, seed: int = 0) -> Sketch:
    """Draw a teapot in ribbons: rings around the body, strokes along handle, spout and legs.

    Handle, spout and legs are drawn from within the body, so their ribbons cross into it. Brush normals are
    on an arbitrary side of each stroke, as in a drawing.

    Parameters
    ----------
    gap
        Distance between the centre lines of neighbouring strokes on the body; the body is 2 wide. In (0,
        0.4].
    overlap
        How much wider than their distance the ribbons are, as a fraction; below 0 leaves gaps.
    tremor
        Standard deviation of the brush's position and (in radians, times 10) of its roll.
    seed
        Of the tremor.

    Returns
    -------
    Sketch
        In the layout of SurfaceBrush: three vertices a station.

    Raises
    ------
    ValueError
        An argument is outside its range.

    Examples
    --------
    >>> teapot_sketch().stroke_count > 40
    True
    """
    if not 0 < gap <= 0.4:
        raise ValueError(f"gap: found {gap}, allowed is above 0 to 0.4")
    if not overlap > -1:
        raise ValueError(f"overlap: found {overlap}, allowed is above -1")
    if tremor < 0:
        raise ValueError(f"tremor: found {tremor}, allowed is 0 or more")
    rng = np.random.default_rng(seed)
    wide = 1.0 + overlap
    strokes = _body(gap, wide) + _handle(gap, wide)
    for limb in _limbs():
        strokes += _limb(*limb, gap, wide)
    return ribbons([_trembling(stroke, tremor, rng) for stroke in strokes])


def _trembling(stroke: Stroke, tremor: float, rng: np.random.Generator) -> Stroke:
    """Displace a stroke smoothly, as an unsteady hand does, and choose the side of its brush."""
    count = len(stroke.centres)
    waves = np.linspace(0.0, 1.0, count)[:, None] * np.arange(1, 4) * 2.0 * np.pi
    # Three sines of variance 1/2 and random phase for each coordinate and the roll: variance 1 altogether.
    drift = np.sqrt(2 / 3) * np.sin(waves[:, None, :] + 2.0 * np.pi * rng.random((4, 3))).sum(axis=2)
    centres = stroke.centres + tremor * drift[:, :3]
    along = np.gradient(stroke.centres, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normals = Rotation.from_rotvec(10.0 * tremor * drift[:, 3:] * along).apply(stroke.normals)
    return Stroke(centres, normals * rng.choice([-1.0, 1.0]), stroke.widths)


def _body(gap: float, wide: float) -> list[Stroke]:
    """Rings of latitude, and straight strokes over the poles."""
    profile = np.linspace(-np.pi / 2, np.pi / 2, 721)
    girth = 0.5 * (_BODY[0] + _BODY[1])
    pieces = np.hypot(np.diff(girth * np.cos(profile)), np.diff(_BODY[2] * np.sin(profile)))
    length = np.concatenate([[0.0], np.cumsum(pieces)])
    # A ring narrower than its own ribbon would fold: the caps are drawn across.
    caps = 1.5 * gap
    count = int(np.ceil((length[-1] - 2 * caps) / gap)) + 1
    strokes = []
    for latitude in np.interp(np.linspace(caps, length[-1] - caps, count), length, profile):
        stations = max(16, round(2 * np.pi * girth * np.cos(latitude) / (0.5 * gap)))
        around = np.linspace(0.0, 2 * np.pi, stations)
        arm, height = np.cos(latitude), np.sin(latitude)
        unit = np.column_stack([arm * np.cos(around), arm * np.sin(around), np.full(stations, height)])
        strokes.append(_on_body(unit, gap * wide))
    for pole in (-1.0, 1.0):
        for offset in (-gap, 0.0, gap):
            x = np.linspace(-caps, caps, 9) / _BODY[0]
            y = np.full(9, offset / _BODY[1])
            strokes.append(_on_body(np.column_stack([x, y, pole * np.sqrt(1.0 - x**2 - y**2)]), gap * wide))
    return strokes


def _on_body(unit: NDArray[np.float64], width: float) -> Stroke:
    normals = unit / _BODY
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Stroke(unit * _BODY, normals, np.full(len(unit), width))


def _handle(gap: float, wide: float) -> list[Stroke]:
    """Strokes along the handle, whose ends lie in the body."""
    major, minor = _HANDLE
    count = max(5, round(2 * np.pi * minor / gap))
    # The arc that is outside of the body, and more at both ends.
    along = np.radians(np.linspace(35, 315, 2 * _LIMB_STEPS))
    out = np.column_stack([np.cos(along), np.sin(along), np.zeros_like(along)])
    strokes = []
    for k in range(count):
        tube = 2 * np.pi * k / count
        normals = np.cos(tube) * out + np.sin(tube) * np.array([0.0, 0.0, 1.0])
        centres = _HANDLE_TURN.apply(major * out + minor * normals) + _HANDLE_AT
        width = 2 * np.pi * minor / count * wide
        strokes.append(Stroke(centres, _HANDLE_TURN.apply(normals), np.full(len(along), width)))
    return strokes


def _limb(
    radius: float, length: float, place: NDArray[np.float64], turn: Rotation, gap: float, wide: float
) -> list[Stroke]:
    """Draw out along one side of a capsule, over its tip and back on the other, open inside the body."""
    count = max(3, round(np.pi * radius / gap))
    side = np.linspace(-0.5 * length, 0.5 * length, _LIMB_STEPS)
    tip = np.linspace(0.0, np.pi, _LIMB_STEPS // 2)[1:-1]
    across = np.concatenate([np.full(_LIMB_STEPS, radius), radius * np.cos(tip), np.full(_LIMB_STEPS, -radius)])
    height = np.concatenate([side, 0.5 * length + radius * np.sin(tip), side[::-1]])
    axis = np.clip(height, None, 0.5 * length)
    strokes = []
    for k in range(count):
        angle = np.pi * k / count
        sideways = np.array([np.cos(angle), np.sin(angle), 0.0])
        centres = across[:, None] * sideways + height[:, None] * np.array([0.0, 0.0, 1.0])
        normals = (centres - axis[:, None] * np.array([0.0, 0.0, 1.0])) / radius
        width = np.pi * radius / count * wide
        strokes.append(Stroke(turn.apply(centres) + place, turn.apply(normals), np.full(len(centres), width)))
    return strokes
