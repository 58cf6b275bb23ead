"""The normals of curves in the plane: lines and parabolas in the place of planes and quadrics.

The steps are those of `fits`, `noise` and `choice`: every line and parabola that contains a point has a say in its
normal, by the inverse of the squared error to be expected of it. Fits are few, so array expressions do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from face_plugin.angles.choice import FLATNESS, FOLD_PLANE, FOLD_QUADRIC, LEAST, OFF, RIM, TOLERANCE
from face_plugin.angles.fits import MOST, SAME_SIDE, WEIGHT_WIDTH
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.curves import tangents

__all__ = ["Curves", "fit_curves", "turn_to_curves"]

# Neighbours of a fit, the point itself among them: each size twice the last, from twice the coefficients of a parabola.
SIZES = (6, 12, 24, 48, 96)
# Before sides are known a line takes those of its own direction to within 45 degrees, of either sign.
SAME_LINE = 0.7
# Fits of this many nearest points are looked at, the point's own among them: half of them lie on its side of a corner.
AROUND = 13
# Neighbours over which the noise is a median.
NOISE_AROUND = 25
# A disc of points has the variance r^2 / 4 along any line.
DISC = 4.0
# Rows at a time: a table of 97 neighbours takes memory.
BLOCK = 16384


@dataclass(frozen=True)
class Curves:
    """What the curve around each of n points is."""

    normals: NDArray[np.float64]
    """(n, 2) unit normals, on the side of those that were given."""
    error: NDArray[np.float64]
    """(n,) expected squared error of the best fit, in squared radians; infinite where there is none."""
    foot: NDArray[np.float64]
    """(n, 2) where the curve passes the point."""


@dataclass(frozen=True)
class _Fits:
    """Fits z = f(x) over the tangent at each of n points, of s sizes and both models, in units of their `reach`."""

    shape: NDArray[np.float64]
    """(s, 2, n, 3) coefficients of 1, x, xx."""
    variance: NDArray[np.float64]
    """(s, 2, n) of the heights, in the squared unit of the points; infinite where nothing was fitted."""
    gain: NDArray[np.float64]
    """(s, 2, n) variance of the slope that heights of unit variance cause."""
    reach: NDArray[np.float64]
    """(s, n) distance to the farthest neighbour."""
    used: NDArray[np.float64]
    """(s, n) neighbours that took part."""


def turn_to_curves(around: Neighbourhood, normals: NDArray[np.float64], *, signed: bool) -> Curves:
    """Turn normals to the angle that the points tell.

    Parameters
    ----------
    around : Neighbourhood
        Of points in the plane.
    normals : (n, 2) float64
        Unit normals, accurate to some tens of degrees.
    signed : bool
        Whether their sides are known: then only neighbours of the same side take part. If not, all that have the same
        line do.

    Examples
    --------
    >>> from face_plugin.shapes.curves import star
    >>> shape = star(400)
    >>> found = turn_to_curves(Neighbourhood(shape.points), shape.normals, signed=True)
    >>> bool(((found.normals * shape.normals).sum(axis=1) > 0.98).all())
    True
    """
    fits = fit_curves(around, normals, signed=signed)
    return _combined(around, normals, fits, _noise(fits, around.neighbour), signed)


def fit_curves(around: Neighbourhood, normals: NDArray[np.float64], *, signed: bool) -> _Fits:
    """Fit a line and a parabola to each point's neighbours, at several sizes; as `turn_to_curves` takes them."""
    n = len(around)
    sizes = [size for size in SIZES if size <= around.neighbour.shape[1]]
    s = len(sizes)
    fits = _Fits(
        shape=np.zeros((s, 2, n, 3)),
        variance=np.full((s, 2, n), np.inf),
        gain=np.full((s, 2, n), np.inf),
        reach=np.ones((s, n)),
        used=np.zeros((s, n)),
    )
    tangent = tangents(normals)
    for start in range(0, n, BLOCK):
        rows = slice(start, start + BLOCK)
        neighbour = around.neighbour[rows]
        offset = around.points[neighbour] - around.points[rows][:, None]
        alike = np.einsum("nkd,nd->nk", normals[neighbour], normals[rows])
        part = _alike(alike, signed)
        part[:, 0] = True
        along = np.einsum("nkd,nd->nk", offset, tangent[rows])
        across = np.einsum("nkd,nd->nk", offset, normals[rows])
        for k, size in enumerate(sizes):
            _fit(fits, k, rows, part[:, :size], along[:, :size], across[:, :size])
    return fits


def _alike(cosine: NDArray[np.float64], signed: bool) -> NDArray[np.bool_]:
    return np.asarray(cosine >= SAME_SIDE if signed else np.abs(cosine) >= SAME_LINE)


def _fit(
    fits: _Fits, k: int, rows: slice, part: NDArray[np.bool_], along: NDArray[np.float64], across: NDArray[np.float64]
) -> None:
    """Fit one size by weighted least squares, and fill it in."""
    squared = along**2 + across**2
    far = (squared * part).max(axis=1)
    far = np.where(far > 0, far, 1.0)
    reach = np.sqrt(far)
    x, z = along / reach[:, None], across / reach[:, None]
    weight = np.where(part, np.exp(-squared / far[:, None] / WEIGHT_WIDTH**2), 0.0)
    count, total = part.sum(axis=1), weight.sum(axis=1)
    doubled = np.einsum("nk,nk->n", weight, weight)
    powers: list[NDArray[np.float64]] = [weight]
    for _ in range(4):
        powers.append(powers[-1] * x)
    moment = [power.sum(axis=1) for power in powers]
    right = np.stack([np.einsum("nk,nk->n", power, z) for power in powers[:3]], axis=1)
    heights = np.einsum("nk,nk,nk->n", weight, z, z)
    fits.reach[k, rows], fits.used[k, rows] = reach, count
    for model, unknowns in enumerate((2, 3)):
        matrix = np.stack([np.stack(moment[i : i + unknowns], axis=1) for i in range(unknowns)], axis=1)
        # The ridge keeps points at one place solvable.
        inverse = np.linalg.inv(matrix + 1e-7 * total[:, None, None] * np.eye(unknowns))
        solution = np.einsum("nij,nj->ni", inverse, right[:, :unknowns])
        rest = np.maximum(heights - np.einsum("ni,ni->n", solution, right[:, :unknowns]), 0.0)
        shown = rest / total * count / np.maximum(count - unknowns, 1)
        enough = count >= unknowns + 2
        fits.shape[k, model, rows, :unknowns] = solution
        spread = far * shown / np.maximum(1.0 / MOST, 1.0 - DISC * shown)
        fits.variance[k, model, rows] = np.where(enough, spread, np.inf)
        fits.gain[k, model, rows] = np.where(enough, inverse[:, 1, 1] * doubled / total / far, np.inf)


def _noise(fits: _Fits, neighbour: NDArray[np.intp]) -> NDArray[np.float64]:
    """Variance (n,) of the points' noise: that of parabolas, as their size goes to nothing.

    A fold's residual grows as the square of the fit's radius, and on a curve so does the square of the number of its
    points.
    """
    if len(fits.reach) < 2:
        return np.zeros(len(neighbour))
    near = neighbour[:, :NOISE_AROUND]
    least, larger = (np.median(fits.variance[k, 1][near], axis=1) for k in range(2))
    least = np.where(np.isfinite(least), least, 0.0)
    larger = np.where(np.isfinite(larger), larger, least)
    small, large = (size**2 for size in SIZES[:2])
    return np.asarray(np.clip((large * least - small * larger) / (large - small), 0.0, least))


def _combined(
    around: Neighbourhood, normals: NDArray[np.float64], fits: _Fits, noise: NDArray[np.float64], signed: bool
) -> Curves:
    """Average all fits that contain a point; see `face_plugin.angles.choice.combine_fits`."""
    points, n = around.points, len(around)
    tangent = tangents(normals)
    found, shift, weights, error = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros(n), np.full(n, np.inf)
    for place in range(min(AROUND, around.neighbour.shape[1])):
        j = around.neighbour[:, place]
        alike = np.einsum("nd,nd->n", normals[j], normals)
        same = _alike(alike, signed)
        sign = np.where(alike < 0, -1.0, 1.0)[:, None]
        offset = points - points[j]
        far = np.einsum("nd,nd->n", offset, offset)
        along = np.einsum("nd,nd->n", offset, tangent[j])
        across = np.einsum("nd,nd->n", offset, normals[j])
        for k, reach in enumerate(fits.reach):
            r, used = reach[j], fits.used[k, j]
            off_middle, x = far / r**2, along / r
            for model, fold in enumerate((FOLD_PLANE, FOLD_QUADRIC)):
                rest = fits.variance[k, model, j]
                good = same & (off_middle <= 1.0 + 1e-9) & np.isfinite(rest)
                if not good.any():
                    continue
                height, slope, bend = fits.shape[k, model, j].T
                rim = 1.0 if model == 0 else 1.0 + RIM * off_middle
                doubt = TOLERANCE * noise * np.sqrt(2.0 / np.maximum(used - model - 2, 1))
                own = across - (height + (slope + bend * x) * x) * r
                beyond = np.maximum(np.where(good, rest, 0.0) - noise - doubt, 0.0) + (doubt if place else 0.0)
                beyond = beyond + np.maximum(own**2 - OFF**2 * noise, 0.0)
                chance = np.where(good, fits.gain[k, model, j], 0.0) * rim * (noise + (FLATNESS * r) ** 2)
                wrong = np.where(good, (fold * rim / r) ** 2 * beyond + chance + LEAST, np.inf)
                error = np.minimum(error, wrong)
                slope = slope + 2.0 * bend * x
                length = np.sqrt(1.0 + slope**2)
                normal = (normals[j] - slope[:, None] * tangent[j]) / length[:, None]
                weight = 1.0 / wrong
                found += weight[:, None] * sign * normal
                shift -= (weight * own / length)[:, None] * normal
                weights += weight
    known = np.linalg.norm(found, axis=1, keepdims=True)
    turned = np.where(known > 0, found / np.where(known > 0, known, 1.0), normals)
    foot = points + shift / np.where(weights > 0, weights, 1.0)[:, None]
    return Curves(turned, error, foot)
