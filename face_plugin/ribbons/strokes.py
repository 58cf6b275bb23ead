"""Strokes as centre lines with brush normals and widths, and the ribbons that they sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.ribbons.sketch import Sketch, assemble

_QUADS = np.array([0, 1, 4, 3, 0, 3, 5, 2])


@dataclass(frozen=True)
class Stroke:
    """A drawn stroke.

    Attributes
    ----------
    centres
        (k, 3) float64: positions of the brush, a station each.
    normals
        (k, 3) float64: normals of the brush, of either side.
    widths
        (k,) float64: full widths of the ribbon.
    """

    centres: NDArray[np.float64]
    normals: NDArray[np.float64]
    widths: NDArray[np.float64]


def tangents(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find unit tangents (k, 3) of a polyline of two or more stations from chords between neighbours."""
    chords = np.gradient(centres, axis=0)
    length = np.linalg.norm(chords, axis=1, keepdims=True)
    # A line that turns back on itself has no chord there: take the next segment.
    chords = np.where(length > 0, chords, np.diff(centres, axis=0, append=2 * centres[-1:] - centres[-2:-1]))
    unit: NDArray[np.float64] = chords / np.maximum(np.linalg.norm(chords, axis=1, keepdims=True), 1e-300)
    return unit


def ribbons(strokes: Sequence[Stroke], problems: Sequence[str] = ()) -> Sketch:
    """Sweep strokes: centre and two borders a station, in the layout of SurfaceBrush.

    Stations that repeat the one before, and strokes that are left with a single station, are reported and
    left out.

    Parameters
    ----------
    strokes
        One or more.
    problems
        Found before; reported with those found here.

    Raises
    ------
    ValueError
        No stroke has two stations.

    Examples
    --------
    >>> import numpy as np
    >>> line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    >>> sketch = ribbons([Stroke(line, np.tile([0.0, 0, 1], (3, 1)), np.full(3, 0.5))])
    >>> float(sketch.areas.sum())
    1.0
    """
    found = list(problems)
    vertices, normals, quads, owners = [], [], [], []
    start = repeated = single = 0
    for k, stroke in enumerate(strokes):
        fresh = np.ones(len(stroke.centres), dtype=bool)
        fresh[1:] = np.linalg.norm(np.diff(stroke.centres, axis=0), axis=1) > 0
        repeated += int((~fresh).sum())
        centres, brush, widths = stroke.centres[fresh], stroke.normals[fresh], stroke.widths[fresh]
        if len(centres) < 2:
            single += 1
            continue
        side = np.cross(tangents(centres), brush)
        side *= 0.5 * widths[:, None] / np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-300)
        vertices.append(np.stack([centres, centres - side, centres + side], axis=1).reshape(-1, 3))
        normals.append(np.repeat(brush, 3, axis=0))
        centre = start + 3 * np.arange(len(centres) - 1)[:, None]
        quads.append((centre + _QUADS).reshape(-1, 4))
        owners.append(np.full(2 * (len(centres) - 1), k))
        start += 3 * len(centres)
    if repeated:
        found.append(f"left out {repeated} stations of zero length")
    if single:
        found.append(f"left out {single} strokes of a single station")
    if not quads:
        raise ValueError(f"the sketch has no stroke of two or more stations: {'; '.join(found) or 'no strokes'}")
    corners = np.concatenate(quads)
    return assemble(
        np.concatenate(vertices),
        [(np.arange(len(corners), dtype=np.int64), corners)],
        ids=np.concatenate(owners),
        normals=np.concatenate(normals),
        problems=found,
    )
