"""polyscope's one window: set up, camera, and the plane that cuts the picture open."""

from __future__ import annotations

from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from face_plugin.errors import FaceError, MissingDependencyError, require

__all__ = ["LIBRARIES", "Up", "knife", "stand", "window"]

Up = Literal["x", "y", "z"]

LIBRARIES = "libegl1 libgl1 libx11-6"
"""Debian's packages of what polyscope loads; they bring Mesa's software renderer along."""

# Where the camera stands at first: azimuth and elevation in degrees; the points then fill this share of the window,
# which is seen under polyscope's angle.
STANDPOINT, FILLED, VIEW_ANGLE = (35.0, 20.0), 0.85, 45.0


def stand(ps: Any, points: NDArray[np.floating], up: Up, size: tuple[int, int]) -> float:
    """Put the camera where `face plot` has it by default, as near as all points (n, 3) allow.

    Returns the length in which polyscope counts radii from now on: the diagonal of the points, whatever is drawn later.

    Parameters
    ----------
    ps
        What `window` returned.
    points
        What is to be seen, in the unit of the input.
    up
        Axis that points upward.
    size
        Width and height of the window.
    """
    k, (azimuth, elevation) = "xyz".index(up), np.radians(STANDPOINT)
    upward, ahead, side = np.eye(3)[k], np.eye(3)[(k + 1) % 3], np.eye(3)[(k + 2) % 3]
    flat = np.cos(azimuth) * ahead + np.sin(azimuth) * side
    towards = np.cos(elevation) * flat + np.sin(elevation) * upward
    right = np.cross(upward, flat)
    lower, upper = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    middle, diagonal = 0.5 * lower + 0.5 * upper, float(np.linalg.norm(upper - lower))
    ps.set_automatically_compute_scene_extents(False)
    ps.set_length_scale(diagonal)
    ps.set_bounding_box(lower, upper)
    across, height, near = ((points - middle) @ np.stack([right, np.cross(towards, right), towards]).T).T
    steep = FILLED * np.tan(np.radians(0.5 * VIEW_ANGLE))
    away = np.maximum(np.abs(across) * size[1] / size[0], np.abs(height)) / steep + near
    ps.look_at_dir(middle + float(away.max()) * towards, middle, upward)
    return diagonal


def window(headless: bool) -> Any:
    """Return polyscope, initialised: once a process, for it is global state."""
    ps = require("polyscope", extra="viewer")
    if ps.is_initialized():
        return ps
    ps.set_verbosity(0)
    ps.set_program_name("face")
    ps.set_use_prefs_file(False)
    ps.set_ground_plane_mode("none")
    ps.set_allow_headless_backends(headless)
    try:
        ps.init()
    except RuntimeError as error:
        if headless:
            raise MissingDependencyError(
                f"polyscope cannot draw without a display here ({error}). "
                f"On Debian or Ubuntu: apt-get install {LIBRARIES}"
            ) from error
        raise FaceError(f"there is no display to open a window on ({error})") from error
    # Every frame that is asked for is drawn, and none left out to keep to a rate.
    ps.set_frame_tick_limit_fps_mode("ignore_limits")
    return ps


@cache
def knife(ps: Any) -> Any:
    """Plane that takes away all before it, invisible itself; one a process, as the window is."""
    plane = ps.add_scene_slice_plane()
    plane.set_draw_plane(False)
    plane.set_draw_widget(False)
    return plane
