"""The coarse cage: over the whole cloud, with a potential that becomes the boundary data of every tile."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from face_plugin.faraday.locate import Locator
from face_plugin.faraday.meshers import CageMesh
from face_plugin.faraday.solve import solve_cage
from face_plugin.geometry import thin
from face_plugin.io.disk import naming
from face_plugin.params import Params

__all__ = ["Coarse", "Voxels", "nearest_to_centres", "solve_coarse", "voxel_size"]

# Occupied voxels a point of the coarse cage: thinning them at VOXELS_APART voxels leaves about this share.
VOXELS_PER_POINT = 1.7
VOXELS_APART = 0.8
# Bits of a voxel's index along an axis.
BITS = 21
# Voxels along the longest side that the search starts from.
FIRST_GRID = 32
SEARCH_STEPS = 20


class Voxels:
    """Even subset of a cloud that is seen in parts: in each voxel, the point nearest to its centre.

    Parameters
    ----------
    origin : (3,) float64
        A corner below all points.
    size : float
        Edge of a voxel, in the points' unit.

    Examples
    --------
    >>> voxels = Voxels(np.zeros(3), 1.0)
    >>> voxels.add(np.array([[0.1, 0.5, 0.5], [0.4, 0.5, 0.5], [1.5, 0.5, 0.5]]))
    >>> voxels.points[:, 0]
    array([0.4, 1.5])
    """

    def __init__(self, origin: NDArray[np.float64], size: float) -> None:
        self.origin = origin
        self.size = size
        self.points = np.empty((0, 3))

    def add(self, points: NDArray[np.float64]) -> None:
        """Take the next part (n, 3) of the cloud into account; the order of the parts does not matter."""
        every = np.concatenate([self.points, points])
        self.points = every[nearest_to_centres(every, self.origin, self.size)]


def nearest_to_centres(points: NDArray[np.float64], origin: NDArray[np.float64], size: float) -> NDArray[np.intp]:
    """Rows of the points (n, 3), one in each voxel that any lies in: the one nearest to its centre.

    Examples
    --------
    >>> nearest_to_centres(np.array([[0.1, 0.5, 0.5], [0.4, 0.5, 0.5], [1.5, 0.5, 0.5]]), np.zeros(3), 1.0)
    array([1, 2])
    """
    if len(points) == 0:
        return np.empty(0, dtype=np.intp)
    code, offset = _voxel(points, origin, size)
    # Ties go by the coordinates: the order of the points does not matter.
    order = np.lexsort((points[:, 2], points[:, 1], points[:, 0], offset, code))
    return np.asarray(order[np.concatenate([[True], np.diff(code[order]) != 0])])


def _voxel(
    points: NDArray[np.float64], origin: NDArray[np.float64], size: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Code of each point's voxel, and the squared distance to its centre in voxels."""
    at = (points - origin) / size
    cell = np.floor(at)
    index = np.clip(cell, 0, (1 << BITS) - 1).astype(np.int64)
    code = (index[:, 0] << 2 * BITS) | (index[:, 1] << BITS) | index[:, 2]
    return code, ((at - cell - 0.5) ** 2).sum(axis=1)


def voxel_size(points: NDArray[np.float64], target: int) -> float:
    """Edge of the voxels of which about `target` are occupied.

    Parameters
    ----------
    points : (n, 3) float64
        The cloud, or a fair sample of it.
    target : int

    Examples
    --------
    >>> plane = np.argwhere(np.ones((64, 64, 1))).astype(float)
    >>> 7.0 < voxel_size(plane, 64) < 9.5
    True
    """
    origin = points.min(axis=0)
    size = float(np.ptp(points, axis=0).max()) / FIRST_GRID
    low, high = 0.0, np.inf
    for _ in range(SEARCH_STEPS):
        occupied = len(np.unique(_voxel(points, origin, size)[0]))
        if abs(occupied - target) <= 0.02 * target or occupied == len(points) < target:
            break
        low, high = (size, high) if occupied > target else (low, size)
        # A surface fills voxels as the square of their number along a side, a volume as the cube.
        guess = size * (occupied / target) ** 0.45
        size = guess if low < guess < high else 0.5 * (low + min(high, 4 * low))
    return size


@dataclass(frozen=True)
class Coarse:
    """The solved coarse cage."""

    mesh: CageMesh
    potential: NDArray[np.float64]
    """(m, 3) at the vertices, in unit fields along the canonical axes."""
    cage_value: NDArray[np.float64]
    """(3,) potential of the cage."""
    locator: Locator

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Potential (k, 3) at positions (k, 3) of the canonical frame, linear in each tetrahedron.

        Outside the box it goes on as the undisturbed external field, which it equals on the box.
        """
        inside = np.clip(points, self.mesh.lower, self.mesh.upper)
        return self.locator.interpolate(inside, self.potential) + (points - inside)

    def save(self, folder: Path) -> None:
        """Write what `load` reads."""
        arrays = {f.name: getattr(self.mesh, f.name) for f in dataclasses.fields(CageMesh)}
        path = folder / "coarse.npz"
        with naming(path):
            np.savez(path, potential=self.potential, cage_value=self.cage_value, **arrays)

    @classmethod
    def load(cls, folder: Path) -> Coarse:
        """Read the coarse cage of a store."""
        with np.load(folder / "coarse.npz") as arrays:
            mesh = CageMesh(**{f.name: arrays[f.name] for f in dataclasses.fields(CageMesh)})
            return cls(mesh, arrays["potential"], arrays["cage_value"], Locator(mesh))


def solve_coarse(voxels: Voxels, params: Params, memory: float | None = None) -> Coarse:
    """Solve a cage of evenly spaced points over the whole cloud.

    Parameters
    ----------
    voxels : Voxels
        The points chosen.
    params : Params
    memory : float, optional
        Bytes that meshing may take, by default all that are free.
    """
    # Neighbouring voxels may hold points that nearly touch: their balls would be small and the gaps beside
    # them wide.
    separation = np.full(len(voxels.points), VOXELS_APART * voxels.size)
    cage = solve_cage(voxels.points, thin(voxels.points, separation, params.seed), params, memory=memory)
    return Coarse(cage.mesh, cage.potential, cage.cage_value, Locator(cage.mesh))
