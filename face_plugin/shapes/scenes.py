"""Generated scans of what encloses nothing, or was scanned from inside: a room, a terrain, a street, a depth frame."""

from __future__ import annotations

import numpy as np

from face_plugin.shapes.scans import Scan, camera_rays, ring_rays, scan_boxes, sphere_rays

__all__ = ["depth_frame", "room", "street", "terrain"]

# Noise of a scanner along its ray, in metres.
NOISE = 0.002
# Rings of a spinning sensor, and how far it sees, in metres.
RINGS = 48
REACH = 40.0
# Waves of the terrain: height in metres, and waves a metre along x and y.
WAVES = ((6.0, 0.010, 0.004), (3.0, -0.012, 0.018), (1.0, 0.045, 0.030), (0.5, -0.05, 0.07))


def room(n: int, seed: int = 0) -> Scan:
    """Furnished room of 5 x 4 x 2.6 m, scanned from two places inside; normals point into the room.

    Examples
    --------
    >>> len(room(500))
    500
    """
    boxes = [
        ((0.0, 0.0, 0.0), (5.0, 4.0, 2.6)),
        ((0.02, 1.0, 0.0), (0.6, 2.6, 2.0)),  # a cupboard
        ((2.6, 2.4, 0.7), (4.2, 3.2, 0.78)),  # a table, its top and two ends
        ((2.65, 2.5, 0.0), (2.75, 3.1, 0.7)),
        ((4.05, 2.5, 0.0), (4.15, 3.1, 0.7)),
        ((3.0, 0.5, 0.0), (3.9, 1.1, 0.45)),  # a chest
    ]
    views = [[1.6, 1.3, 1.4], [3.6, 1.7, 1.5]]
    return scan_boxes(boxes, views, sphere_rays(-(-n // 2)), n, np.random.default_rng(seed), noise=NOISE)


def terrain(n: int, seed: int = 0) -> Scan:
    """Hills of 200 x 200 m, points at random as from an aeroplane; normals point up.

    Examples
    --------
    >>> bool((terrain(500).normals[:, 2] > 0).all())
    True
    """
    rng = np.random.default_rng(seed)
    flat = 200.0 * rng.random((n, 2))
    height, slope = np.zeros(n), np.zeros((n, 2))
    for tall, *wave in WAVES:
        turns = 2.0 * np.pi * np.asarray(wave)
        height += tall * np.sin(flat @ turns)
        slope += tall * np.cos(flat @ turns)[:, None] * turns
    normals = np.column_stack([-slope, np.ones(n)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # Five centimetres of noise, as airborne scans have.
    points = np.column_stack([flat, height + 0.05 * rng.normal(size=n)])
    return Scan(points, normals, up=np.array([0.0, 0.0, 1.0]))


def street(n: int, seed: int = 0) -> Scan:
    """Road between two rows of houses, scanned in rings from three places along it; normals face the road.

    Examples
    --------
    >>> len(street(500).viewpoints)
    3
    """
    rng = np.random.default_rng(seed)
    boxes = [((-60.0, -30.0, -1.0), (60.0, 30.0, 0.0))]
    for side in (-1.0, 1.0):
        for start in np.arange(-45.0, 45.0, 15.0):
            # Houses stand 7 to 9 m from the middle of the road, with gaps of 2 m between them.
            front = side * rng.uniform(7.0, 9.0)
            back, height = front + side * 10.0, rng.uniform(6.0, 11.0)
            boxes.append(((start, min(front, back), 0.0), (start + 13.0, max(front, back), height)))
        for at in (-20.0, 5.0):
            # Parked cars.
            boxes.append(((at, side * 4.5 - 0.9, 0.0), (at + 4.4, side * 4.5 + 0.9, 1.5)))
    views = [[-14.0, 0.3, 1.9], [0.0, 0.0, 1.9], [14.0, -0.3, 1.9]]
    # A third of the rays or fewer go to the sky or too far.
    rays = ring_rays(RINGS, -(-n // (2 * RINGS)))
    return scan_boxes(boxes, views, rays, n, rng, noise=5.0 * NOISE, reach=REACH)


def depth_frame(n: int, seed: int = 0) -> Scan:
    """Things on a table before a wall in one frame of a depth camera at the origin; normals face the camera.

    Examples
    --------
    >>> depth_frame(500).viewpoints.tolist()
    [[0.0, 0.0, 0.0]]
    """
    boxes = [
        ((2.4, -3.0, -3.0), (2.6, 3.0, 3.0)),
        ((0.7, -1.2, -0.55), (1.8, 1.2, -0.5)),
        ((1.1, -0.5, -0.5), (1.35, -0.2, -0.2)),
        ((1.0, 0.1, -0.5), (1.2, 0.45, -0.35)),
        ((1.4, 0.2, -0.5), (1.6, 0.4, 0.1)),
    ]
    height = int(np.ceil(np.sqrt(n * 3.0 / 4.0)))
    rays = camera_rays(-(-n // height), height, [1.0, 0.0, -0.25])
    return scan_boxes(boxes, np.zeros((1, 3)), rays, n, np.random.default_rng(seed), noise=NOISE)
