"""Which points a closed surface encloses: by rays, or by the generalised winding number.

Both take surfaces whose normals point outwards, such as `face_plugin.faraday.isosurface` extracts, and call a point
inside where it is enclosed. On a closed surface that does not cross itself, and whose shells alternate (the
wall of a cavity faces into the cavity), they agree at every point that is not within single precision of the
surface, about 1e-6 of its extent. They differ

- where a surface crosses itself, or contains a shell of the same orientation: the winding number is 2 in the
  inner part and 1 around it, both above the threshold; a ray from around it may see the inner part's outer
  side first and then votes for outside;
- at a shell that is turned inside out: the winding number is -1 in it and 0 around it, below the threshold; a
  ray from around it sees its far side from behind and votes for inside;
- where a surface has a hole: the winding number fades to a fraction there, the rays' vote is the share of
  directions that miss the hole, so the threshold and the majority draw different lines;
- on the surface itself: neither is defined.
"""

from __future__ import annotations

import logging
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.faraday.solid_angles import winding_number

__all__ = ["inside", "inside_by_rays", "inside_by_winding"]

log = logging.getLogger(__name__)

_ROUNDS = 3
"""How often rays are cast, at most, from a point whose vote is undecided."""
_UNDECIDED = 0.25
"""Share of the votes that the minority needs for a vote to be undecided."""
_JITTER = 0.1
"""Random turn of each ray, in radians, so that no ray runs along edges that are aligned with others."""
_RAYS_AT_ONCE = 1 << 20
"""How many rays are in memory at a time."""


def inside(
    points: ArrayLike, v: ArrayLike, f: ArrayLike, method: Literal["rays", "winding"] = "rays"
) -> NDArray[np.bool_]:
    """Tell which points a closed surface encloses.

    Parameters
    ----------
    points : (n, 3) array_like of float
        Points to classify, in the unit of `v`.
    v : (k, 3) array_like of float
        Vertices of the surface.
    f : (q, 3) array_like of int
        Triangles of the surface, their normals pointing outwards. Triangles of zero area have no effect.
    method : {"rays", "winding"}, default: "rays"
        `inside_by_rays` or `inside_by_winding`; the module's description says when they differ.

    Returns
    -------
    (n,) ndarray of bool
        Whether each point is inside; all False for a surface without triangles.

    Raises
    ------
    ValueError
        If `method` is unknown, or an array has the wrong shape, is not finite or names a vertex that does not
        exist.

    Examples
    --------
    >>> v = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> f = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    >>> inside([[0.1, 0.1, 0.1], [1.0, 1.0, 1.0]], v, f)
    array([ True, False])
    """
    if method == "rays":
        return inside_by_rays(points, v, f)
    if method == "winding":
        return inside_by_winding(points, v, f)
    raise ValueError(f"method: 'rays' or 'winding' is allowed, got {method!r}")


def inside_by_rays(
    points: ArrayLike, v: ArrayLike, f: ArrayLike, *, directions: int = 12, seed: int = 0
) -> NDArray[np.bool_]:
    """Tell which points a closed surface encloses, from what rays hit first.

    A ray that first hits the surface from behind votes for inside; one that hits it from the front, or hits
    nothing, votes for outside. The majority decides. Where the minority has a quarter of the votes or more,
    rays are cast in fresh directions, up to twice; `inside_by_winding` decides what is still undecided then.

    Parameters
    ----------
    points, v, f
        As of `inside`.
    directions : int, default: 12
        Rays from each point and round.
    seed : int, default: 0
        Seed of the random directions; equal arguments give equal results.

    Returns
    -------
    (n,) ndarray of bool

    Raises
    ------
    ValueError
        As of `inside`, or `directions` is below 1.

    Notes
    -----
    Takes the place of the winding number in section 3.4 of the paper; exact but for single precision, in
    which Embree works, and faster. Coordinates are centred and scaled first. Without Embree, an extra, as it
    has no wheel for Linux on ARM, the winding number answers, which is said once in the log.

    Examples
    --------
    >>> v = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> f = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    >>> inside_by_rays([[0.1, 0.1, 0.1], [0.4, 0.4, 0.4]], v, f)
    array([ True, False])
    """
    if directions < 1:
        raise ValueError(f"directions: at least 1 is needed, got {directions}")
    queries, corners, faces = _checked(points, v, f)
    queries, corners = _unit_box(queries, corners, faces)
    if not _embree_loads():
        return inside_by_winding(points, v, f)
    result = np.zeros(len(queries), dtype=bool)
    single = corners.astype(np.float32)
    normals = _normals(single, faces)
    solid = normals.any(axis=1)
    if not solid.any():
        return result
    rays = _Rays(single, faces[solid], normals[solid])
    rng = np.random.default_rng(seed)
    votes = np.zeros(len(queries), dtype=np.int64)
    undecided = np.flatnonzero((np.abs(queries) <= np.abs(corners).max(axis=0)).all(axis=1))
    for cast in range(1, _ROUNDS + 1):
        for part in np.array_split(undecided, max(1, -(-len(undecided) * directions // _RAYS_AT_ONCE))):
            votes[part] += rays.votes(queries[part], directions, rng)
        share = votes[undecided] / (cast * directions)
        result[undecided] = share > 0.5
        undecided = undecided[(share >= _UNDECIDED) & (share <= 1 - _UNDECIDED)]
        if not len(undecided):
            return result
    result[undecided] = inside_by_winding(queries[undecided], corners, faces)
    return result


def inside_by_winding(points: ArrayLike, v: ArrayLike, f: ArrayLike, *, threshold: float = 0.9) -> NDArray[np.bool_]:
    """Tell where the generalised winding number of a surface exceeds a threshold.

    Parameters
    ----------
    points, v, f
        As of `inside`; the surface may be open.
    threshold : float, default: 0.9
        Winding number that a point inside exceeds; the paper's value.

    Returns
    -------
    (n,) ndarray of bool

    Notes
    -----
    Paper section 3.4, by the fast winding number (Barill et al. 2018). Coordinates are centred and scaled first.

    Examples
    --------
    >>> v = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> f = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    >>> inside_by_winding([[0.1, 0.1, 0.1], [0.4, 0.4, 0.4]], v, f)
    array([ True, False])
    """
    queries, corners, faces = _checked(points, v, f)
    queries, corners = _unit_box(queries, corners, faces)
    faces = faces[_normals(corners, faces).any(axis=1)]
    if not len(faces) or not len(queries):
        return np.zeros(len(queries), dtype=bool)
    return winding_number(queries, corners, faces) > threshold


@cache
def _embree_loads() -> bool:
    try:
        import embreex.rtcore_scene  # noqa: F401
    except (ImportError, OSError) as error:
        log.info(
            "embreex cannot be loaded (%s): the winding number tells what is inside; rays are faster: "
            "pip install 'face-plugin[embree]'",
            error,
        )
        return False
    return True


class _Rays:
    """A surface in Embree."""

    def __init__(self, corners: NDArray[np.float32], faces: NDArray[np.int64], normals: NDArray[np.float64]) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        # Without `robust` rays slip through between triangles that share an edge.
        self.scene = EmbreeScene(robust=True)
        self.mesh = TriangleMesh(self.scene, corners, faces.astype(np.int32))
        # Our own normals instead of Embree's, whose sense has changed between its versions.
        self.normals = normals

    def votes(self, origins: NDArray[np.float64], directions: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Count the rays from each origin that first hit the surface from behind."""
        rays = _spread(directions, rng) + _JITTER * rng.standard_normal((len(origins), directions, 3))
        ray = np.ascontiguousarray(rays.reshape(-1, 3), dtype=np.float32)
        start = np.repeat(origins.astype(np.float32), directions, axis=0)
        hit = np.asarray(self.scene.run(start, ray, query="INTERSECT"))
        behind = (hit >= 0) & (np.einsum("ij,ij->i", ray, self.normals[hit]) > 0)
        count: NDArray[np.int64] = behind.reshape(-1, directions).sum(axis=1)
        return count


def _spread(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Spread unit vectors evenly over the sphere, along a Fibonacci spiral that is turned at random."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - height**2)
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    spiral = np.stack([flat * np.cos(angle), flat * np.sin(angle), height], axis=1)
    return np.asarray(spiral @ turn)


def _normals(corners: NDArray[Any], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Give normals as long as twice the area, in double precision."""
    a, b, c = (corners[column].astype(np.float64) for column in faces.T)
    return np.cross(b - a, c - a)


def _unit_box(
    queries: NDArray[np.float64], corners: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre the surface and scale it to an extent of 1, so that single precision serves it best."""
    used = np.zeros(len(corners), dtype=bool)
    used[faces] = True
    lower, upper = (corners[used].min(axis=0), corners[used].max(axis=0)) if len(faces) else np.zeros((2, 3))
    extent = float((upper - lower).max())
    scale = 1 / extent if extent > 0 else 1.0
    middle = lower + 0.5 * (upper - lower)
    return (queries - middle) * scale, (corners - middle) * scale


def _checked(
    points: ArrayLike, v: ArrayLike, f: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Convert the arguments, or raise `ValueError`."""
    arrays = []
    for name, data in (("points", points), ("v", v)):
        array = np.asarray(data, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f"{name}: an array of shape (n, 3) is needed, got {array.shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name}: finite coordinates are needed, got NaN or infinity")
        arrays.append(array)
    faces = np.asarray(f)
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise ValueError(f"f: integers of shape (q, 3) are needed, got {faces.dtype} of shape {faces.shape}")
    if faces.size and (faces.min() < 0 or faces.max() >= len(arrays[1])):
        raise ValueError(f"f: indices from 0 to {len(arrays[1]) - 1} are allowed, got {faces.min()} to {faces.max()}")
    return arrays[0], arrays[1], faces.astype(np.int64)
