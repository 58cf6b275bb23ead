"""The viewer: points, normals, proxy and field, to carve and to shield by clicks (extra ``viewer``)."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.app.viewer.session import MODES, Plane, Session
from face_plugin.app.viewer.viewport import Up, knife, stand, window
from face_plugin.errors import FaceError, require
from face_plugin.sculpt import Edit
from face_plugin.solver import FaCE

__all__ = ["Viewer"]

log = logging.getLogger(__name__)

# A press and a release this near to each other, in pixels, are a click; farther apart, the view was turned.
STILL = 4.0
# Limits of the slider of alpha and of the colours of log10 E_max.
ALPHA = (1e-4, 0.5)
DECADES = (-4.0, 0.0)
# Radius of a point, and length and radius of its normal, in radii of a ball: what is behind shows between them.
POINT, ARROW = 0.45, (2.0, 0.12)
SIDE, INSIDE, PROXY = (0.45, 0.6, 0.8), (0.85, 0.3, 0.25), (0.95, 0.8, 0.55)
NORMAL = (0.3, 0.3, 0.35)
CHARGE, SHIELD, MESH = (1.0, 0.75, 0.0), (0.1, 0.6, 0.2), (0.8, 0.8, 0.78)


class Viewer:
    """A window on a `Session`; there is one window a process.

    Parameters
    ----------
    session : Session
    sculpt_file, mesh_file : path
        Where the buttons save to, unless changed in the window.
    headless : bool
        Draw without a window, for `screenshot`.
    up : {"x", "y", "z"}
        Axis of the input that points upward.
    cut : {"x", "y", "z"}, optional
        Begin with the object cut open in the middle, across that axis, and the field shown there.
    size : (width, height) in pixels

    Raises
    ------
    MissingDependencyError
        polyscope is not installed, or, headless, finds no OpenGL.
    FaceError
        There is no display.

    Examples
    --------
    >>> import tempfile
    >>> from face_plugin.shapes import sphere
    >>> viewer = Viewer(Session(sphere(200).points), headless=True, size=(320, 240))
    >>> viewer.screenshot(tempfile.mkdtemp() + "/sphere.png")
    """

    def __init__(
        self,
        session: Session,
        *,
        sculpt_file: str | os.PathLike[str] = "sculpt.json",
        mesh_file: str | os.PathLike[str] = "sculpted.ply",
        headless: bool = False,
        up: Up = "z",
        cut: Up | None = None,
        size: tuple[int, int] = (1280, 800),
    ) -> None:
        self.session = session
        self.message = "look: drag to turn, scroll to zoom"
        self.files = {"sculpt": str(sculpt_file), "mesh": str(mesh_file)}
        self._drawn: dict[str, Any] = {}
        self._inside: NDArray[np.bool_] = np.zeros(len(session.points), dtype=np.bool_)
        self._surface: tuple[FaCE, float, bool] | None = None
        self._ps: Any = window(headless)
        self._gui: Any = require("polyscope.imgui", extra="viewer")
        self._ps.set_window_size(*size)
        self._ps.set_up_dir(f"{up}_up")
        self._ps.remove_all_structures()
        self._ps.set_user_callback(self.frame)
        self._knife: Any = knife(self._ps)
        self.open = cut is not None
        if cut is not None:
            session.plane = Plane("xyz".index(cut), session.plane.place)
        # What is to be seen at first: the points, and where the field is shown.
        shown = session.points if cut is None else np.concatenate([session.points, session.cut(2)[0]])
        self._scale = stand(self._ps, shown, up, size)
        self.draw()

    def show(self) -> None:
        """Open the window and return when it is closed."""
        self._ps.show()

    def screenshot(self, path: str | os.PathLike[str], *, panels: bool = False) -> None:
        """Write what is to be seen to a .png or .jpg, with the panels or without."""
        self._ps.frame_tick()
        self._ps.screenshot(str(path), transparent_bg=False, include_UI=panels)

    def frame(self) -> None:
        """Draw the panel and follow the mouse: what polyscope calls for every frame."""
        self._panel()
        self._mouse()
        if self.session.mode != "look" and self._ps.have_selection():
            # What polyscope says of the element that was clicked on would cover the place of the next click.
            self._ps.reset_selection()
        self.draw()

    def pick(self, x: float, y: float) -> None:
        """Do what a click does at a place of the window, in pixels from its upper left corner."""
        hit = self._ps.pick(screen_coords=(x, y))
        if not hit.is_hit or self.session.mode == "look":
            return
        normal = None
        if hit.structure_name == "proxy":
            vertices, faces = self._drawn["proxy"][1]
            a, b, c = vertices[faces[hit.structure_data["index"]]]
            normal = np.cross(b - a, c - a)
            normal = normal / max(float(np.linalg.norm(normal)), 1e-300)
        with self._reporting():
            made = self.session.click(hit.position, normal)
            self.message = "; ".join(map(_describe, made))

    def draw(self) -> None:
        """Bring the picture up to date; what has not changed is left alone."""
        face, alpha, plane = self.session.face, self.session.alpha, self.session.plane
        # An edit is to be seen at once: which points are interior takes longer, and is told one frame later.
        if not self._update("points", (face,), self._draw_points):
            self._update("interior", (face, alpha, self.session.automatic), self._draw_interior)
        self._update("proxy", (face, alpha), self._draw_proxy)
        self._update("field", (face, plane), self._draw_field)
        self._update("knife", (plane, self.open), self._place_knife)
        self._update("edits", (face,), self._draw_edits)
        # A surface that does not go with the points any more would mislead.
        if self._surface is not None and self._surface != (face, alpha, self.session.automatic):
            self._ps.remove_surface_mesh("surface", error_if_absent=False)
            self._surface = None

    def _update(self, name: str, state: tuple[Any, ...], draw: Callable[[], Any]) -> bool:
        """Draw if the state is another than at the last time, and tell whether it was."""
        # The states are compared by identity: equal arrays in another cage are another drawing.
        known = self._drawn.get(name, ((), None))[0]
        if len(known) == len(state) and all(a is b or a == b for a, b in zip(known, state, strict=True)):
            return False
        self._drawn[name] = state, draw()
        return True

    def _draw_points(self) -> None:
        session = self.session
        cloud = self._ps.register_point_cloud("points", session.points)
        size = float(np.median(session.face.balls.radii)) * session.face.frame.scale
        cloud.set_radius(POINT * size, relative=False)
        length, radius = ARROW
        cloud.add_vector_quantity(
            "normals",
            length * size * session.face.normals(),
            enabled=True,
            vectortype="ambient",
            radius=radius * size / self._scale,
            color=NORMAL,
        )
        self._colour(self._inside)

    def _draw_interior(self) -> None:
        self._inside = self.session.interior()
        self._colour(self._inside)

    def _colour(self, inside: NDArray[np.bool_]) -> None:
        colours = np.where(inside[:, None], INSIDE, SIDE)
        self._ps.get_point_cloud("points").add_color_quantity("interior", colours, enabled=True)

    def _draw_proxy(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        vertices, faces = self.session.proxy()
        if len(faces) == 0:
            self._ps.remove_surface_mesh("proxy", error_if_absent=False)
        else:
            mesh = self._ps.register_surface_mesh("proxy", vertices, faces, color=PROXY, transparency=0.5)
            # A click is to hit a face: vertices and edges have no side.
            mesh.set_selection_mode("faces_only")
        return vertices, faces

    def _draw_field(self) -> None:
        vertices, quads, strength = self.session.cut()
        mesh = self._ps.register_surface_mesh("field", vertices, quads, enabled=self._enabled("field"))
        decades = np.log10(np.maximum(strength, 10.0 ** DECADES[0]))
        mesh.add_scalar_quantity("log10 E_max", decades, enabled=True, vminmax=DECADES, cmap="viridis")

        # Half transparent: what lies behind, points inside the object among it, is what it is to explain.
        mesh.set_transparency(0.5)
        mesh.set_ignore_slice_plane(self._knife, True)

    def _place_knife(self) -> None:
        """Take away what lies on the upper side of the plane, where the camera stands at first."""
        self._knife.set_active(self.open)
        if self.open:
            normal = -np.eye(3)[self.session.plane.axis]
            self._knife.set_pose(self.session.middle_of_plane(), normal)
            self._ps.get_surface_mesh("field").set_enabled(True)

    def _draw_edits(self) -> None:
        for name, kind, colour in (("charges", "charge", CHARGE), ("cage points", "cage", SHIELD)):
            places = [edit.places for edit in self.session.face.edits if edit.kind == kind]
            if places:
                cloud = self._ps.register_point_cloud(name, np.concatenate(places), radius=0.01, color=colour)
                cloud.set_ignore_slice_plane(self._knife, True)
            else:
                self._ps.remove_point_cloud(name, error_if_absent=False)

    def _enabled(self, name: str) -> bool:
        """Whether the user has the mesh of that name switched on; at first it is off."""
        return bool(self._ps.has_surface_mesh(name) and self._ps.get_surface_mesh(name).is_enabled())

    def _panel(self) -> None:
        gui, session = self._gui, self.session
        for mode in MODES:
            if gui.RadioButton(mode, session.mode == mode):
                session.mode = mode
                self.message = f"{mode}: click on the proxy, a point or the field" if mode != "look" else "look"
            gui.SameLine()
        gui.NewLine()
        changed, alpha = gui.SliderFloat("alpha", session.alpha, *ALPHA, "%.4f", gui.ImGuiSliderFlags_Logarithmic)
        if changed:
            with self._reporting():
                session.alpha = alpha
        gui.SameLine()
        _, session.automatic = gui.Checkbox("auto", session.automatic)
        for label, act in (("undo", session.undo), ("redo", session.redo), ("clear", session.clear)):
            if gui.Button(label):
                with self._reporting():
                    act()
                    self.message = f"{len(session.face.edits)} edits"
            gui.SameLine()
        gui.NewLine()
        moved, place = gui.SliderFloat("field at", session.plane.place, 0.0, 1.0)
        turned, axis = gui.Combo("field across", session.plane.axis, ["x", "y", "z"])
        if moved or turned:
            session.plane = Plane(axis, place)
            self._ps.get_surface_mesh("field").set_enabled(True)
        _, self.open = gui.Checkbox("cut open", self.open)
        for name, save in (("sculpt", session.save_sculpt), ("mesh", session.save_mesh)):
            if gui.Button(f"save {name}"):
                with self._reporting():
                    save(Path(self.files[name]))
                    self.message = f"{self.files[name]} is saved"
            gui.SameLine()
            _, self.files[name] = gui.InputText(f"##{name} file", self.files[name])
        if gui.Button("show surface"):
            with self._reporting():
                vertices, faces = session.surface()
                self._ps.register_surface_mesh("surface", vertices, faces, color=MESH, smooth_shade=True)
                self._surface = session.face, session.alpha, session.automatic
                self.message = f"{len(faces):,} triangles"
        gui.TextWrapped(self.message)

    def _mouse(self) -> None:
        """Turn a click into an edit; drags and double clicks turn and centre the view and are polyscope's."""
        io = self._gui.GetIO()
        if not self._gui.IsMouseReleased(0) or io.WantCaptureMouse or io.MouseClickedLastCount[0] > 1:
            return
        if np.hypot(*np.subtract(io.MousePos, io.MouseClickedPos[0])) <= STILL:
            self.pick(*io.MousePos)

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        """Say what was refused in the panel; the window stays open."""
        try:
            yield
        except (ValueError, FaceError, OSError) as error:
            log.info("refused: %s", error)
            self.message = str(error)


def _describe(edit: Edit) -> str:
    if edit.kind == "cage":
        return f"{len(edit.places)} vertices of the mesh joined the cage"
    return f"charge at ({', '.join(f'{x:.4g}' for x in edit.places[0])})"
