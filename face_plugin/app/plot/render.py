"""A small software renderer: triangles and points through a depth buffer, shaded afterwards.

It needs no graphics card and no display. Every pixel gets the nearest thing under it (`raster`); light and
ambient occlusion are then computed per pixel, at twice the size of the picture, and averaged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter, zoom

from face_plugin.app.plot.raster import Buffer, draw_discs, draw_triangles

__all__ = ["Camera", "Image", "Up", "View", "render_mesh", "render_points"]

Array = NDArray[Any]
Image = NDArray[np.uint8]
Up = Literal["x", "y", "z"]
View = tuple[float, float]
"""Azimuth and elevation of the camera, in degrees."""

OVERSAMPLING = 2
CLAY = (0.80, 0.78, 0.74)
BACK = (0.76, 0.47, 0.37)
# Directions towards the lights in the frame of the camera (right, up, towards), and their strengths.
LIGHTS = (((-0.45, 0.65, 0.62), 0.72), ((0.80, 0.10, 0.35), 0.22))
AMBIENT = 0.26
WRAP = 0.35


@dataclass(frozen=True)
class Camera:
    """An orthographic camera.

    Examples
    --------
    >>> import numpy as np
    >>> Camera.around(np.eye(3), view=(0.0, 0.0)).axes.shape
    (3, 3)
    """

    axes: Array
    """(3, 3) rows: right, up and towards the camera, in the axes of the object."""
    centre: Array
    """(3,) what the middle of the picture shows."""
    extent: float
    """Width and height of the picture, in the unit of the object."""

    @classmethod
    def around(cls, points: ArrayLike, *, view: View = (35.0, 20.0), up: Up = "z", margin: float = 1.06) -> Camera:
        """Look at all points from azimuth and elevation (degrees), with one axis pointing upward."""
        azimuth, elevation = np.radians(view)
        k = "xyz".index(up)
        upward, ahead, side = np.eye(3)[k], np.eye(3)[(k + 1) % 3], np.eye(3)[(k + 2) % 3]
        flat = np.cos(azimuth) * ahead + np.sin(azimuth) * side
        towards = np.cos(elevation) * flat + np.sin(elevation) * upward
        right = np.cross(upward, flat)
        axes = np.stack([right, np.cross(towards, right), towards])
        seen = np.asarray(points, dtype=np.float64) @ axes.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        extent = margin * float(max(high[0] - low[0], high[1] - low[1], np.finfo(np.float64).tiny))
        return cls(axes, (0.5 * (low + high)) @ axes, extent)

    def project(self, points: ArrayLike, pixels: int) -> Array:
        """Return (k, 3): column, row and height towards the camera, all in pixels."""
        seen = (np.asarray(points, dtype=np.float64) - self.centre) @ self.axes.T * (pixels / self.extent)
        return np.stack([seen[:, 0] + pixels / 2, pixels / 2 - seen[:, 1], seen[:, 2]], axis=1)


def _shade(buffer: Buffer, normals: Array, colours: Array, back: ArrayLike | None) -> Image:
    """Light the pixels (normals and colours of the covered ones) and average them to the picture."""
    covered = buffer.owner >= 0
    away = normals[:, 2] < 0
    colours = colours.copy()
    if back is not None:
        colours[away] = back
    facing = np.where(away[:, None], -normals, normals)
    light = AMBIENT * (0.8 + 0.2 * facing[:, 1])
    for direction, strength in LIGHTS:
        # Wrapped around the terminator, so that the far side keeps its relief.
        slant = facing @ (np.array(direction, np.float32) / np.float32(np.linalg.norm(direction)))
        light += strength * np.maximum((slant + WRAP) / (1 + WRAP), 0.0)
    half = np.array(LIGHTS[0][0]) / np.linalg.norm(LIGHTS[0][0]) + np.array([0.0, 0.0, 1.0])
    shine = 0.10 * np.maximum(facing @ (half / np.linalg.norm(half)), 0.0) ** 30
    light *= _openness(buffer)[covered]
    image = np.zeros((buffer.pixels * buffer.pixels, 4), dtype=np.float32)
    image[covered, :3] = np.clip(colours * light[:, None] + shine[:, None], 0.0, 1.0)
    image[covered, 3] = 1.0
    size = buffer.pixels // OVERSAMPLING
    blocks = image.reshape(size, OVERSAMPLING, size, OVERSAMPLING, 4).mean(axis=(1, 3))
    # Undo the weighting of the colour by coverage: the picture's alpha is not premultiplied.
    blocks[..., :3] /= np.maximum(blocks[..., 3:], 1e-9)
    return np.asarray(np.round(blocks * 255), dtype=np.uint8)


def _openness(buffer: Buffer) -> Array:
    """Darken what lies lower than its surroundings: depth unsharp masking (Luft et al. 2006)."""
    shape = (buffer.pixels, buffer.pixels)
    covered = (buffer.owner >= 0).reshape(shape)
    height = np.where(covered, buffer.height.reshape(shape), np.float32(0))
    # The surroundings are smooth: a quarter of the resolution is enough for them.
    weight, small = covered[::4, ::4].astype(np.float32), height[::4, ::4]
    result = np.ones(shape, dtype=np.float32)
    for width, strength in ((0.006, 0.9), (0.03, 0.5)):
        sigma = width * buffer.pixels / 4
        mean = gaussian_filter(small, sigma) / np.maximum(gaussian_filter(weight, sigma), 1e-6)
        around = zoom(mean, np.array(shape) / mean.shape, order=1, grid_mode=True, mode="nearest")
        result -= strength * np.clip((around - height) / (32 * sigma), 0.0, 0.35)
    return result.ravel()


def render_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    camera: Camera | None = None,
    size: int = 800,
    colour: tuple[float, float, float] = CLAY,
    back: tuple[float, float, float] | None = BACK,
    colours: ArrayLike | None = None,
    smooth: bool = True,
) -> Image:
    """Render a triangle mesh, shaded, on a transparent ground.

    Parameters
    ----------
    vertices : (k, 3) array_like, any unit
    faces : (f, 3) array_like of int
        Counter-clockwise seen from outside.
    camera : Camera, optional
        By default one that shows the whole mesh.
    size : int
        Width and height of the picture in pixels.
    colour : 3 floats
        Of the front, red, green and blue in [0, 1].
    back : 3 floats or None
        Of faces seen from behind (a hole, or a wrong orientation); None: as the front.
    colours : (k, 3) array_like, optional
        Colours of the vertices in [0, 1] instead of `colour`.
    smooth : bool
        Interpolate normals between the faces.

    Returns
    -------
    (size, size, 4) uint8
        Red, green, blue and opacity.

    Raises
    ------
    ValueError
        The mesh is empty.

    Examples
    --------
    >>> import numpy as np
    >>> render_mesh(np.eye(3), [[0, 1, 2]], size=32).shape
    (32, 32, 4)
    """
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)
    if not len(vertices) or not len(faces):
        raise ValueError(f"nothing to render: {len(vertices)} vertices and {len(faces)} faces")
    camera = camera or Camera.around(vertices)
    buffer = Buffer(size * OVERSAMPLING)
    corners = vertices[faces]
    draw_triangles(buffer, camera.project(vertices, buffer.pixels)[faces])
    covered = buffer.owner >= 0
    owner, weights = buffer.owner[covered], buffer.spot[covered]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ camera.axes.T
    normals = (flat / _length(flat)).astype(np.float32)[owner]
    if smooth:
        summed = np.stack([_sum_at(faces, flat[:, k], len(vertices)) for k in range(3)], axis=1)
        soft = _blend(summed / _length(summed), faces[owner], weights)
        # Interpolation must not turn the side of a face that the camera sees.
        kept = soft[:, 2] * normals[:, 2] >= 0
        normals[kept] = soft[kept] / _length(soft[kept])
    if colours is None:
        painted = np.tile(np.array(colour, dtype=np.float32), (len(owner), 1))
    else:
        painted = _blend(np.asarray(colours), faces[owner], weights)
    return _shade(buffer, normals, painted, back)


def _blend(values: Array, corners: Array, weights: Array) -> Array:
    """Interpolate values (k, 3) of vertices at the pixels, in single precision: there are millions."""
    values = values.astype(np.float32)
    return np.asarray(sum(values[corners[:, k]] * weights[:, k, None] for k in range(3)))


def _sum_at(faces: Array, values: Array, count: int) -> Array:
    totals: Array = np.bincount(faces.ravel(), weights=np.repeat(values, 3), minlength=count)
    return totals


def _length(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.maximum(length, np.finfo(length.dtype).tiny))


def render_points(
    points: ArrayLike,
    colours: ArrayLike,
    *,
    radius: float,
    normals: ArrayLike | None = None,
    camera: Camera | None = None,
    size: int = 800,
) -> Image:
    """Render points as balls, or as discs across their normals, shaded, on a transparent ground.

    Parameters
    ----------
    points : (n, 3) array_like, any unit
    colours : (n, 3) array_like
        In [0, 1].
    radius : float
        Of a ball or disc, in the unit of the points.
    normals : (n, 3) array_like, optional
        Unit normals; with them the points are drawn as discs.
    camera : Camera, optional
        By default one that shows all points.
    size : int
        Width and height of the picture in pixels.

    Returns
    -------
    (size, size, 4) uint8

    Examples
    --------
    >>> import numpy as np
    >>> render_points(np.eye(3), np.ones((3, 3)), radius=0.1, size=32).shape
    (32, 32, 4)
    """
    points = np.asarray(points, dtype=np.float64)
    camera = camera or Camera.around(points)
    buffer = Buffer(size * OVERSAMPLING)
    scale = buffer.pixels / camera.extent
    turned = None if normals is None else np.asarray(normals, dtype=np.float64) @ camera.axes.T
    # Below 1.5 pixels a ball could fall between the pixels' centres.
    draw_discs(buffer, camera.project(points, buffer.pixels), turned, max(radius * scale, 1.5))
    covered = buffer.owner >= 0
    painted = np.asarray(colours, dtype=np.float32)[buffer.owner[covered]]
    return _shade(buffer, buffer.spot[covered], painted, None)
