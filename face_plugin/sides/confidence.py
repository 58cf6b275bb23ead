"""How far the side of a normal can be trusted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.neighbourhood import Neighbourhood

__all__ = ["confidence", "witness"]


def confidence(
    around: Neighbourhood,
    witnessed: NDArray[np.float64],
    normals: NDArray[np.float64],
    rows: NDArray[np.intp] | slice = slice(None),
) -> NDArray[np.float64]:
    """Confidence (k,) in the side of each normal, in [0, 1].

    The product of two figures that are both 1 on a clean, closed surface:

    - ``(1 + cos(angle between the normal and its witness)) / 2``: do field, or sensors, and the points agree?
    - the jump of the winding number across the point, seen with a kernel one spacing wide: 1 for a plane of evenly
      spaced points, less at gaps, near other sheets and where neighbours point the other way, clipped to [0, 1].

    It ranks errors; it is not a probability.

    Parameters
    ----------
    around : Neighbourhood
        Of the points.
    witnessed : (n, 3) float64
        As `witness` has it.
    normals : (n, 3) float64
        Final unit normals.
    rows : (k,) intp or slice
        Points of which it is wanted; by default all.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> bool(confidence(Neighbourhood(ball.points), ball.normals, ball.normals).min() > 0.8)
    True
    """
    spacing = around.spacing
    width = np.zeros(len(around))
    width[rows] = spacing[rows]
    outward = around.tree.outward(normals, width)[rows]
    # An infinite plane of dipoles has 4 pi |grad w| = 2 pi / eps with the kernel's width eps.
    jump = np.einsum("nd,nd->n", outward, normals[rows]) * spacing[rows] / (2 * np.pi)
    agreement = 0.5 * (1.0 + np.einsum("nd,nd->n", witnessed[rows], normals[rows]))
    return np.asarray(np.clip(agreement, 0.0, 1.0) * np.clip(jump, 0.0, 1.0))


def witness(votes: NDArray[np.float64], seen: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Directions (n, 3) that the sides of normals are held against; zero where there is none.

    Parameters
    ----------
    votes : (n, 3) float64
        What the field says of each normal, outward.
    seen : (n, 3) float64, optional
        Directions in which sensors saw the points, zero where none did. The field is no witness then: in a room it
        points out of the walls.

    Examples
    --------
    >>> witness(np.eye(3)[:2], np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0]]))
    array([[0., 0., 1.],
           [0., 0., 0.]])
    """
    if seen is None:
        return votes
    length = np.linalg.norm(seen, axis=1, keepdims=True)
    return np.asarray(seen / np.where(length > 0, length, 1.0))
