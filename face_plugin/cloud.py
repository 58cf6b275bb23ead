"""Check the input once and put it into a canonical frame.

This is the only place that judges bad input. What leaves it is finite, distinct, of unit size, and in an
order that depends on the positions alone, so that everything after it is independent of the order of the
input and of where, how large and how rotated the object is.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

__all__ = ["SPACE_OR_PLANE", "Cloud", "Frame", "as_points", "morton_distinct", "prepare"]

log = logging.getLogger(__name__)

MINIMUM_POINTS = 4
# Dimensions of points that are served.
SPACE_OR_PLANE = (3, 2)
# Points nearer than this fraction of the diagonal are one point: below it, balls and tetrahedra degenerate in
# double precision.
MERGE_TOLERANCE = 1e-10
# Smallest relative extent that still counts as a dimension of the object.
FLAT_TOLERANCE = 1e-9
# Principal axes are used only where they are well separated: on a cube or a sphere rounding would choose
# them.
AXIS_GAP = 1e-3
MORTON_BITS = 20


@dataclass(frozen=True)
class Frame:
    """Similarity between the input's coordinates and the canonical ones, ``x_unit = R (x - origin) / scale``.

    Examples
    --------
    >>> frame = Frame(np.zeros(3), np.eye(3), 2.0)
    >>> frame.to_unit(np.array([[2.0, 0.0, 0.0]]))
    array([[1., 0., 0.]])
    """

    origin: NDArray[np.float64]
    """(d,) centre of the input, in its unit; d is 3, or 2 in the plane."""
    rotation: NDArray[np.float64]
    """(d, d) rotation R; its rows are the axes of the canonical frame."""
    scale: float
    """Length of the canonical frame's unit, in the input's unit."""

    def to_unit(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Positions (k, d) from the input's coordinates to the canonical frame."""
        unit = (np.asarray(points, dtype=np.float64) - self.origin) / self.scale
        return np.asarray(unit @ self.rotation.T)

    def from_unit(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (k, d) from the canonical frame to the input's coordinates."""
        return np.asarray((points @ self.rotation) * self.scale + self.origin)

    def rotate(self, vectors: NDArray[np.floating]) -> NDArray[np.float64]:
        """Directions (k, d) from the input's axes to the canonical ones."""
        return np.asarray(np.asarray(vectors, dtype=np.float64) @ self.rotation.T)

    def unrotate(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Directions (k, d) from the canonical axes to the input's."""
        return np.asarray(vectors @ self.rotation)


@dataclass(frozen=True)
class Cloud:
    """The distinct points of the input in the canonical frame, and the way back."""

    points: NDArray[np.float64]
    """(m, d) distinct points in the canonical frame, in Morton order; d is 3, or 2 in the plane."""
    rows: NDArray[np.intp]
    """(n,) the row of `points` that each input point became."""
    frame: Frame
    dtype: np.dtype[np.floating]
    """Floating-point type of the input: results are given in it."""
    flat: bool
    """Whether points in space lie in one plane: the side of their normals is then arbitrary."""

    @property
    def size(self) -> int:
        """Number n of input points."""
        return len(self.rows)

    @property
    def dimension(self) -> int:
        """3, or 2 in the plane."""
        return int(self.points.shape[1])

    def plane_normal(self) -> NDArray[np.float64]:
        """Return the canonical unit normal (3,) of the plane of best fit, its greatest component positive."""
        normal = np.linalg.svd(self.points - self.points.mean(axis=0), full_matrices=False)[2][2]
        return np.asarray(normal * np.sign(normal[np.argmax(np.abs(normal))]))


def as_points(points: ArrayLike, name: str = "points", dimensions: tuple[int, ...] = (3,)) -> NDArray[np.floating]:
    """Return `points` as a finite (n, 3) array of float32 or float64, or say what is wrong with it.

    Parameters
    ----------
    points : (n, d) array_like
    name : str
        What to call it.
    dimensions : tuple of int
        Allowed values of d: `SPACE_OR_PLANE`, or 3 alone.

    Raises
    ------
    ValueError
        Naming the argument, what was found and what is allowed.

    Examples
    --------
    >>> as_points([[0, 0, 1]]).dtype
    dtype('float64')
    """
    if _is_masked(points):
        # NumPy would drop the mask, and what lies under it would become points.
        raise ValueError(f"{name} must not hold masked values, found a mask: leave out its rows")
    shapes = " or ".join(f"(n, {d})" for d in dimensions)
    try:
        array = np.asarray(points)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} must be an {shapes} array of numbers: {error}") from None
    if array.dtype.kind in "iub":
        array = array.astype(np.float64)
    if array.dtype.kind != "f":
        raise ValueError(f"{name} must hold real numbers, found dtype {array.dtype}")
    if array.dtype not in (np.float32, np.float64):
        array = array.astype(np.float32 if array.dtype.itemsize < 4 else np.float64)
    if array.ndim != 2 or array.shape[1] not in dimensions:
        hint = "; transpose it" if array.ndim == 2 and array.shape[0] in dimensions else ""
        if array.ndim == 2 and array.shape[1] == 2 and name == "points":
            hint = "; in the plane there are normals, interior points and the field, and nothing else"
        raise ValueError(f"{name} must have the shape {shapes}, found {array.shape}{hint}")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        first = ", ".join(map(str, bad[:5])) + (", ..." if len(bad) > 5 else "")
        raise ValueError(f"{name} must be finite, found NaN or infinity in {len(bad)} of {len(array)} rows: {first}")
    return array


def _is_masked(points: ArrayLike) -> bool:
    """Whether an array, or a row of a list, has values that count as missing."""
    rows = points if isinstance(points, (list, tuple)) else [points]
    return any(np.ma.is_masked(row) for row in rows)


def prepare(points: ArrayLike) -> Cloud:
    """Check the input, merge coincident points and move them into the canonical frame.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit; or (n, 2) in the plane
        At least four distinct points that do not lie on one line.

    Returns
    -------
    Cloud

    Raises
    ------
    ValueError
        Wrong shape, NaN or infinity, fewer than four distinct points, or all points on one line.

    Examples
    --------
    >>> prepare([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 3], [0, 0, 3]]).points.shape
    (4, 3)
    """
    array = as_points(points, dimensions=SPACE_OR_PLANE)
    if len(array) < MINIMUM_POINTS:
        raise ValueError(f"points must hold at least {MINIMUM_POINTS} points, found {len(array)}")
    origin, scale = _extent(array)
    # Repeated points go first, and the rest into an order of their own, so that neither they nor the order of
    # the input can change a sum.
    sort, first = _sorted_distinct(array.astype(np.float64))
    work = (array[sort[first]].astype(np.float64) - origin) / scale
    axes, extent = _axes(work)
    # Rounding to the input's own precision does not give a line or a plane a thickness.
    rounding = float(np.finfo(array.dtype).eps) * float(np.abs(array).max()) / scale
    flat_tolerance = max(FLAT_TOLERANCE, 4 * rounding)
    if extent[1] <= flat_tolerance:
        raise ValueError("points must not all lie on one line: a line has no normal")
    # The box along the input's axes has served; that along the canonical ones turns with the points.
    work = work @ axes.T
    lower, upper = work.min(axis=0), work.max(axis=0)
    diagonal = float(np.linalg.norm(upper - lower))
    centre = 0.5 * (lower + upper)
    work = (work - centre) / diagonal
    frame = Frame(origin + scale * (centre @ axes), axes, scale * diagonal)
    order, leads = morton_distinct(work)
    distinct = work[order[leads]]
    if len(distinct) < MINIMUM_POINTS:
        raise ValueError(
            f"points must hold at least {MINIMUM_POINTS} distinct points, found {len(distinct)} among {len(array)}"
        )
    place = np.empty(len(work), dtype=np.intp)
    place[order] = np.cumsum(leads) - 1
    rows = np.empty(len(array), dtype=np.intp)
    rows[sort] = place[np.cumsum(first) - 1]
    if len(distinct) < len(array):
        log.info("%d of %d points coincide with another one", len(array) - len(distinct), len(array))
    flat = len(extent) == 3 and bool(extent[2] <= flat_tolerance)
    if flat:
        log.warning("all points lie in one plane: the side that their normals point to is arbitrary")
    return Cloud(distinct, rows, frame, array.dtype, flat)


def _extent(array: NDArray[np.floating]) -> tuple[NDArray[np.float64], float]:
    """Centre (d,) and diagonal of the bounding box, without overflow or underflow on the way."""
    lower, upper = array.min(axis=0).astype(np.float64), array.max(axis=0).astype(np.float64)
    with np.errstate(over="ignore"):
        side = upper - lower
        longest = float(side.max())
        if longest == 0.0:
            raise ValueError(f"points must be distinct, found {len(array)} points at one place")
        diagonal = longest * float(np.linalg.norm(side / longest)) if math.isfinite(longest) else math.inf
    # Twice: the box along other axes is longer, by sqrt(3) at most.
    if not math.isfinite(2 * diagonal):
        raise ValueError("points must span a finite length, found coordinates whose difference overflows")
    return 0.5 * lower + 0.5 * upper, diagonal


def _sorted_distinct(points: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Lexical order of points, and which of the sorted ones differs from its predecessor."""
    order = np.lexsort(points.T)
    differs = (np.diff(points[order], axis=0) != 0).any(axis=1)
    return order, np.concatenate([[True], differs])


def _axes(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Right-handed canonical axes (rows), and the relative extent of the points along the principal ones."""
    centred = points - points.mean(axis=0)
    variance, vectors = np.linalg.eigh(centred.T @ centred / len(points))
    variance, axes = np.maximum(variance[::-1], 0.0), vectors[:, ::-1].T
    extent = np.ptp(centred @ axes.T, axis=0) / np.ptp(centred @ axes[0])
    if np.min((variance[:-1] - variance[1:]) / variance[0]) < AXIS_GAP:
        return np.eye(len(axes)), extent
    # An axis has no sign of its own: take the one with positive skewness, which turns with the points.
    skewness = ((centred @ axes.T) ** 3).mean(axis=0)
    axes = axes * np.where(skewness < 0, -1.0, 1.0)[:, None]
    if np.linalg.det(axes) < 0:
        axes[np.argmin(np.abs(skewness) / np.maximum(variance, 1e-30) ** 1.5)] *= -1
    return axes, extent


def morton_distinct(points: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Order points of unit size by Morton code, twins together; and tell which ones lead their twins.

    Points nearer than `MERGE_TOLERANCE` are twins, and so are the twins of twins.

    Examples
    --------
    >>> order, leads = morton_distinct(np.array([[1.0, 1, 1], [0, 0, 0], [1, 1, 1 + 1e-12]]))
    >>> order, leads
    (array([1, 0, 2]), array([ True,  True, False]))
    """
    lower = points.min(axis=0)
    cell = np.floor((points - lower) * (2**MORTON_BITS - 1) / np.ptp(points, axis=0).max()).astype(np.uint64)
    code = np.zeros(len(points), dtype=np.uint64)
    for axis in range(points.shape[1]):
        code |= _spread_bits(cell[:, axis]) << np.uint64(axis)
    order = np.lexsort((*points.T[::-1], code))
    step = np.abs(np.diff(points[order], axis=0)).max(axis=1)
    leads = np.concatenate([[True], step > MERGE_TOLERANCE])
    # Twins on two sides of a border between cells are far apart in the order.
    heads = points[order[leads]]
    pairs = cKDTree(heads).query_pairs(MERGE_TOLERANCE, output_type="ndarray")
    if len(pairs) == 0:
        return order, leads
    link = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(heads), len(heads)))
    group = connected_components(link, directed=False)[1]
    # Groups are numbered by their first member, so a stable sort keeps the Morton order.
    _, first, group = np.unique(group, return_index=True, return_inverse=True)
    rank = first[group][np.cumsum(leads) - 1]
    moved = np.argsort(rank, kind="stable")
    return order[moved], np.concatenate([[True], np.diff(rank[moved]) > 0])


def _spread_bits(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Put two zero bits between the bits of 21-bit integers."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return x
