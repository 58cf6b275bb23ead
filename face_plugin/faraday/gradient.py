"""Normals from the field strength: it grows outward, so its gradient at a ball points outward (paper section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.faraday.balls import Balls
from face_plugin.faraday.field import vertex_gradients
from face_plugin.faraday.meshers import CageMesh
from face_plugin.geometry import log_ramp, unit
from face_plugin.threads import KDTree

__all__ = ["FieldAtPoints", "ball_means", "carry", "field_at_points", "field_normals"]

CARRY_NEIGHBOURS = 3
# E_max below which double precision leaves nothing of the direction of its gradient; unshielded space has 1.
ROUNDING = 1e-9
# Change of E_max over a ball's radius, relative to E_max there, from which one side counts as shielded: where E_max is
# linear from 0 on one side of the ball to its value on the other, the change over the radius is half of that value.
SHIELDED = 0.5
# E_max from and to which a side is lit: less may have leaked in between the balls (the paper's alpha is 0.01 to 0.05).
LIT = (1e-3, 1e-1)


@dataclass(frozen=True)
class FieldAtPoints:
    """What the field says of points."""

    strength: NDArray[np.float64]
    """(n,) E_max at the nearest ball."""
    normals: NDArray[np.float64]
    """(n, d) unit gradients of E_max, which point outward."""
    difference: NDArray[np.float64]
    """(n,) how far the two sides differ, in [0, 1]: 0 where the field is alike on both, 1 where one is shielded."""

    @property
    def lean(self) -> NDArray[np.float64]:
        """How clearly (n,) the field tells the sides, in [0, 1]: `difference`, less where the field may be a leak."""
        return self.difference * log_ramp(self.strength, LIT)

    @property
    def votes(self) -> NDArray[np.float64]:
        """`normals` (n, d), zero where there is no field: its gradient there is rounding, and must not spread."""
        return np.where((self.strength > ROUNDING)[:, None], self.normals, 0.0)


def field_at_points(
    mesh: CageMesh, strength: NDArray[np.float64], balls: Balls, points: NDArray[np.float64]
) -> FieldAtPoints:
    """Field strength and its gradient at points, from the balls nearest to them.

    Parameters
    ----------
    mesh : CageMesh
    strength : (m,) float64
        E_max at the vertices of the mesh.
    balls : Balls
        Of the mesh.
    points : (n, d) float64
        In the frame of the mesh.
    """
    ball = KDTree(balls.centres).query(points)[1]
    gradient = ball_means(mesh, vertex_gradients(mesh, strength[:, None])[:, :, 0])
    at_balls = ball_means(mesh, strength)
    change, shielded = np.linalg.norm(gradient, axis=1) * balls.radii, SHIELDED * at_balls
    difference = np.minimum(change, shielded) / np.maximum(shielded, np.finfo(float).tiny)
    return FieldAtPoints(at_balls[ball], carry(balls.centres, unit(gradient), points), difference[ball])


def ball_means(mesh: CageMesh, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of vertex values (m, ...) over the cage vertices of each ball: (b, ...)."""
    owned = np.flatnonzero(mesh.owner >= 0)
    owner = mesh.owner[owned]
    count = np.bincount(owner)
    flat = values[owned].reshape(len(owned), -1)
    means = np.stack([np.bincount(owner, weights=column) for column in flat.T], axis=1) / count[:, None]
    return np.asarray(means.reshape(len(count), *values.shape[1:]))


def field_normals(mesh: CageMesh, strength: NDArray[np.float64]) -> NDArray[np.float64]:
    """Average the gradient of E_max over the cage vertices of each ball, and normalise it (paper equation 6).

    Parameters
    ----------
    mesh : CageMesh
    strength : (m,) float64

    Returns
    -------
    (b, d) float64
    """
    gradient = vertex_gradients(mesh, strength[:, None])[:, :, 0]
    return unit(ball_means(mesh, gradient))


def carry(
    centres: NDArray[np.float64], normals: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Give points (n, d) without a ball normals: those of the nearest balls, weighted by inverse distance.

    A point that is a ball's centre keeps that ball's normal exactly.

    Examples
    --------
    >>> carry(np.eye(3), np.eye(3), np.array([[1.0, 0.0, 0.0]]))
    array([[1., 0., 0.]])
    """
    distance, ball = KDTree(centres).query(points, k=min(CARRY_NEIGHBOURS, len(centres)))
    weight = 1.0 / np.maximum(distance, 1e-300)
    weight /= weight.max(axis=1, keepdims=True)
    # Relative to the nearest: neighbours across a thin wall must not turn it around.
    near = normals[ball]
    agree = np.einsum("nkd,nd->nk", near, near[:, 0])
    return unit(np.einsum("nk,nkd->nd", weight * np.maximum(agree, 0.0), near))
