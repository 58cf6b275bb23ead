"""Sample data by name, generated, so that everything in the documentation runs as printed.

from face_plugin import examples

scan = examples.load("room")
scan.points, scan.viewpoints, scan.normals  # the normals are the true ones
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from face_plugin.geometry import unit
from face_plugin.ribbons.generator import teapot_sketch, teapot_solids
from face_plugin.ribbons.sampling import sample
from face_plugin.shapes.bodies import demo_shape
from face_plugin.shapes.scans import Scan
from face_plugin.shapes.scenes import depth_frame, room, street, terrain

__all__ = ["NAMES", "POINTS", "load"]

POINTS = 8000
"""How many points an example has by default."""


def _object(n: int, seed: int) -> Scan:
    shape = demo_shape(n, seed)
    return Scan(shape.points, shape.normals)


def _sketch(n: int, seed: int) -> Scan:
    sketch = teapot_sketch(seed=seed)
    samples = sample(sketch, n, seed=seed)
    a, b, c = sketch.vertices[sketch.faces[samples.faces]].transpose(1, 0, 2)
    normals = unit(np.cross(b - a, c - a))
    # Outward of the solid whose surface the stroke follows.
    step = 0.01 * normals
    solids = teapot_solids()
    owner = np.argmin([np.abs(solid.level(samples.points)) for solid in solids], axis=0)
    rise = np.stack([solid.level(samples.points + step) - solid.level(samples.points - step) for solid in solids])
    outward = np.where(rise[owner, np.arange(n)] < 0, -1.0, 1.0)
    return Scan(samples.points, normals * outward[:, None])


_MAKERS: dict[str, Callable[[int, int], Scan]] = {
    "object": _object,
    "room": room,
    "terrain": terrain,
    "street": street,
    "frame": depth_frame,
    "sketch": _sketch,
}
NAMES = tuple(_MAKERS)
"""What there is: a teapot of crossing parts with a box left inside, a furnished room scanned from inside, hills seen
from above, a road between houses, one frame of a depth camera, and a teapot drawn in ribbons."""


def load(name: str, n: int = POINTS, seed: int = 0) -> Scan:
    """Generate an example; the same arguments give the same points.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    n : int
        Number of points, 100 or more.
    seed : int
        Of the random numbers.

    Returns
    -------
    Scan
        Points, true normals, and where the sensors stood. Scans are in metres.

    Raises
    ------
    ValueError
        There is no such example, or `n` is too small.

    Examples
    --------
    >>> load("room", 500).viewpoints.shape
    (2, 3)
    """
    if name not in _MAKERS:
        raise ValueError(f"name: found {name!r}, allowed are {', '.join(NAMES)}")
    if n < 100:
        raise ValueError(f"n: found {n}, allowed is 100 or more")
    return _MAKERS[name](n, seed)
