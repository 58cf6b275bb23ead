"""Large clouds with truth: the demo's teapot with a box inside, sampled evenly enough at any size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from face_plugin.shapes.bodies import teapot_solids
from face_plugin.shapes.solids import block
from face_plugin.tiles.coarse import Voxels, voxel_size

# Candidates a point kept. The generators of `face_plugin.shapes` throw darts: minutes for a million points.
CANDIDATES = 4
# Points inside by less than this, in the body's own unit of about its radius, lie on the surface.
DEPTH = 1e-3


@dataclass(frozen=True)
class LargeCloud:
    """Points with the outward normals of the parts they lie on, and which are inside another part."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    interior: NDArray[np.bool_]


def teapot_with_box(n: int, seed: int = 0) -> LargeCloud:
    """Return about n points (within 2 %): one in each voxel that a surface passes."""
    turn = Rotation.from_euler("xyz", [15, 25, 40], degrees=True)
    solids = [*teapot_solids(), block((0.6, 0.45, 0.35)).moved((0.0, 0.05, 0.1), turn)]
    rng = np.random.default_rng(seed)
    area = sum(solid.area for solid in solids)
    drawn = [solid.sample(round(CANDIDATES * n * solid.area / area), rng) for solid in solids]
    points = np.concatenate([p for p, _ in drawn])
    normals = np.concatenate([v for _, v in drawn])
    part = np.repeat(np.arange(len(solids)), [len(p) for p, _ in drawn])
    interior = np.zeros(len(points), dtype=np.bool_)
    for k, solid in enumerate(solids):
        interior |= (part != k) & (solid.level(points) < -DEPTH)
    size = voxel_size(points, n)
    voxels = Voxels(points.min(axis=0) - size, size)
    voxels.add(points)
    # Voxels return positions: look up whose they are.
    rows = rng.permutation(cKDTree(points).query(voxels.points, workers=-1)[1])
    return LargeCloud(points[rows], normals[rows], interior[rows])
