"""What the viewer shows and what its clicks and buttons do; knows of no window."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.cloud import as_points
from face_plugin.estimate import solve_whole
from face_plugin.execution import Execution
from face_plugin.faraday.isosurface import fill_balls, isosurface
from face_plugin.io import CLOUD_SUFFIXES, MESH_SUFFIXES, CloudFile, check_output, write_cloud, write_mesh
from face_plugin.params import Params
from face_plugin.sculpt import Edit, SculptFile
from face_plugin.sides.sensors import Sensors
from face_plugin.solver import FaCE
from face_plugin.stages import Progress
from face_plugin.surface import poisson_reconstruction

__all__ = ["MODES", "Mode", "Plane", "Session"]

Mode = Literal["look", "carve", "shield", "sensor"]
MODES: tuple[Mode, ...] = ("look", "carve", "shield", "sensor")

# States kept for undo; each holds a field.
LONGEST_HISTORY = 50
# A click on the proxy may hit a ball: how far off the proxy to try, in spacings of the points.
STEPS = (0.0, 0.5, 1.0, 1.5, 2.0)
# The slice reaches beyond the points by this fraction of their extent: about as far as the box.
MARGIN = 0.08
# Depth of the octree of the surface: fast enough to wait for.
DEPTH = 8


@dataclass(frozen=True)
class Plane:
    """Where the field is cut."""

    axis: int = 1
    """Axis of the input that the plane is perpendicular to, 0 to 2."""
    place: float = 0.5
    """Place along it, as a fraction of the extent of the points, 0 to 1."""


class Session:
    """A cloud, its cage, and the edits made so far, with undo and redo.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit
    params : Params, optional
    execution : Execution, optional
    sculpt : SculptFile or path, optional
        Edits to start with.
    sensors : Sensors, optional
        Where sensors stood, as far as it is known.
    progress : callable, optional
        ``progress(stage, fraction)`` while the cage is solved.

    Attributes
    ----------
    points : (n, 3) float
    mode : {"look", "carve", "shield", "sensor"}
        What a click does.
    automatic : bool
        Whether points are interior as ``alpha="auto"`` has it, and not by `alpha` alone. Setting `alpha` ends it.
    plane : Plane

    Examples
    --------
    >>> from face_plugin.shapes import spherical_shell
    >>> session = Session(spherical_shell(500).points)
    >>> session.mode = "carve"
    >>> session.click([0.0, 0.0, 0.0])[0].kind
    'charge'
    >>> session.undo()
    >>> session.face.edits
    ()
    """

    def __init__(
        self,
        points: ArrayLike,
        params: Params | None = None,
        *,
        execution: Execution | None = None,
        sculpt: SculptFile | str | os.PathLike[str] | None = None,
        sensors: Sensors | None = None,
        progress: Progress | None = None,
    ) -> None:
        # A bad file is said before the cage is solved.
        first = SculptFile() if sculpt is None else sculpt
        first = first if isinstance(first, SculptFile) else SculptFile.load(first)
        self.points = as_points(points)
        solved = solve_whole(
            self.points, params, purpose="sculpting", sensors=sensors, execution=execution, progress=progress
        )
        # Refining normals takes longer than an edit: they are refined when the surface is made.
        self._angles = solved.params.angles
        self._states = [solved.with_angles("field").sculpted(first)]
        self._now = 0
        self._alpha = self.face.proxy_level
        self.automatic = self.face.params.alpha == "auto"
        self.mode: Mode = "look"
        self.plane = Plane()
        self._flags: tuple[FaCE, float | str, NDArray[np.bool_]] | None = None

    @property
    def face(self) -> FaCE:
        """The cage with the present edits, another object after each of them; its normals are the field's."""
        return self._states[self._now]

    @property
    def alpha(self) -> float:
        """Field strength on the proxy and, unless `automatic`, below which points are interior; (0, 1)."""
        return self._alpha

    @alpha.setter
    def alpha(self, alpha: float) -> None:
        self._alpha = float(Params(alpha=alpha).alpha)
        self.automatic = False

    def click(self, position: ArrayLike, normal: ArrayLike | None = None) -> tuple[Edit, ...]:
        """Do what `mode` says at a place that was clicked on.

        Parameters
        ----------
        position : (3,) array_like of float, in the coordinates of the input
        normal : (3,) array_like of float, optional
            Outward unit normal of the surface that was clicked on: where a ball is in the way, the edit is
            made a little off it.

        Returns
        -------
        tuple of Edit
            What was made; nothing in the modes "look" and "sensor". A sensor stands where the click was.

        Raises
        ------
        ValueError
            The edit is refused.
        """
        if self.mode == "look":
            return ()
        place = np.asarray(position, dtype=np.float64)
        if self.mode == "sensor":
            up = None if self.face.sensors is None else self.face.sensors.up
            self._push(self.face.seen_by(Sensors(np.concatenate([self.viewpoints, place[None]]), up=up)))
            return ()
        ways = [place]
        if normal is not None:
            spacing = 2 * float(np.median(self.face.balls.radii)) * self.face.frame.scale
            ways = [place + step * spacing * np.asarray(normal) for step in STEPS]
        refusals = []
        for at in ways:
            twin = self.face.sculpted(SculptFile())
            try:
                made = (
                    twin.add_charges(at[None], alpha=self.alpha)
                    if self.mode == "carve"
                    else twin.add_cage_points(at[None])
                )
            except ValueError as error:
                refusals.append(error)
                continue
            self._push(twin)
            return made
        raise refusals[0]

    def clear(self) -> None:
        """Take all edits and sensors back; this can be undone too."""
        if self.face.edits or self.face.sensors is not None:
            twin = self.face.seen_by(None)
            twin.clear_edits()
            self._push(twin)

    def undo(self) -> None:
        """Go back to before the last edit, if there is one."""
        self._now = max(self._now - 1, 0)

    def redo(self) -> None:
        """Take back the last `undo`, if nothing was edited since."""
        self._now = min(self._now + 1, len(self._states) - 1)

    def _push(self, state: FaCE) -> None:
        self._states = [*self._states[: self._now + 1], state][-LONGEST_HISTORY:]
        self._now = len(self._states) - 1

    @property
    def viewpoints(self) -> NDArray[np.float64]:
        """Where sensors stand (k, 3), in the unit of the input."""
        sensors = self.face.sensors
        return np.empty((0, 3)) if sensors is None or sensors.viewpoints is None else np.asarray(sensors.viewpoints)

    def lit(self) -> NDArray[np.bool_] | None:
        """Which points (n,) a sensor sees; None without sensors."""
        return self.face.looked_at

    def lit_places(self, places: NDArray[np.float64]) -> NDArray[np.bool_] | None:
        """Which places (k, 3), in the unit of the input, a sensor sees past the points; None without sensors."""
        return None if self.face.sensors is None else self.face.lit(places)

    def interior(self) -> NDArray[np.bool_]:
        """Which points (n,) lie inside the object, by the present field."""
        alpha = "auto" if self.automatic else self.alpha
        if self._flags is None or self._flags[0] is not self.face or self._flags[1] != alpha:
            self._flags = self.face, alpha, self.face.interior(alpha)
        return self._flags[2]

    def proxy(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Isosurface of E_max at `alpha`: vertices (k, 3) in the unit of the input, triangles (f, 3)."""
        vertices, faces = isosurface(*fill_balls(self.face.mesh, self.face.vertex_strength), self.alpha)
        return self.face.frame.from_unit(vertices), faces

    def middle_of_plane(self) -> NDArray[np.float64]:
        """Position (3,) in the middle of `plane`, in the unit of the input."""
        lower, upper = self.points.min(axis=0).astype(np.float64), self.points.max(axis=0).astype(np.float64)
        middle, axis = 0.5 * lower + 0.5 * upper, self.plane.axis
        middle[axis] = lower[axis] + self.plane.place * (upper[axis] - lower[axis])
        return np.asarray(middle)

    def cut(self, resolution: int = 128) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
        """E_max on `plane`: vertices (k, 3) of a grid, its quads (q, 4), strength (k,)."""
        lower, upper = self.points.min(axis=0).astype(np.float64), self.points.max(axis=0).astype(np.float64)
        margin = MARGIN * float((upper - lower).max())
        u, v = (k for k in range(3) if k != self.plane.axis)
        t = np.linspace(0.0, 1.0, resolution)
        grid = np.empty((resolution, resolution, 3))
        grid[..., u] = (lower[u] - margin + t * (upper[u] - lower[u] + 2 * margin))[:, None]
        grid[..., v] = lower[v] - margin + t * (upper[v] - lower[v] + 2 * margin)
        grid[..., self.plane.axis] = self.middle_of_plane()[self.plane.axis]
        row = (np.arange(resolution - 1)[:, None] * resolution + np.arange(resolution - 1)).ravel()
        quads = np.stack([row, row + resolution, row + resolution + 1, row + 1], axis=1)
        vertices = grid.reshape(-1, 3)
        return vertices, quads, self.face.strength(vertices)

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Vertices and triangles of the Poisson surface of the points that are not interior."""
        kept = ~self.interior()
        refined = self.face.with_angles(self._angles)
        vertices, faces, _ = poisson_reconstruction(
            self.points[kept], refined.normals()[kept], depth=DEPTH, open_at=refined.open[kept]
        )
        return vertices, faces

    def save_sculpt(self, path: str | os.PathLike[str]) -> None:
        """Write the edits as JSON, for `face mesh --sculpt`."""
        SculptFile.of(self.face.edits).save(check_output(path, (".json",)))

    def save_viewpoints(self, path: str | os.PathLike[str]) -> None:
        """Write where sensors stand, for ``--viewpoints`` of any command."""
        output = check_output(path, CLOUD_SUFFIXES)
        if not len(self.viewpoints):
            raise ValueError("there are no sensors: choose the mode sensor, and click where they stood")
        write_cloud(output, CloudFile(self.viewpoints))

    def save_mesh(self, path: str | os.PathLike[str]) -> None:
        """Write `surface` to a .ply, .obj, .stl or .off file."""
        output = check_output(path, MESH_SUFFIXES)
        write_mesh(output, *self.surface())
