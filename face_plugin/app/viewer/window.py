"""The viewer: points, normals, proxy and field, to carve and to shield by clicks (extra ``viewer``)."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from face_plugin.app.viewer.picture import Picture
from face_plugin.app.viewer.session import MODES, Plane, Session
from face_plugin.app.viewer.viewport import Up, stand, window
from face_plugin.errors import FaceError, require
from face_plugin.sculpt import Edit

__all__ = ["Viewer"]

log = logging.getLogger(__name__)

# A press and a release this near to each other, in pixels, are a click; farther apart, the view was turned.
STILL = 4.0
# Limits of the slider of alpha.
ALPHA = (1e-4, 0.5)
FILTER_WIDTH = 110
"""Of the slider that moves the filter across the points, in pixels."""
HINTS = {
    "look": "look: drag to turn, scroll to zoom",
    "carve": "carve: click on the proxy, a point or the field",
    "shield": "shield: click on the proxy, a point or the field",
    "sensor": "sensor: click where one stood, best on the field",
}


class Viewer:
    """A window on a `Session`; there is one window a process.

    Parameters
    ----------
    session : Session
    sculpt_file, mesh_file, viewpoints_file : path
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
        viewpoints_file: str | os.PathLike[str] = "viewpoints.csv",
        headless: bool = False,
        up: Up = "z",
        cut: Up | None = None,
        size: tuple[int, int] = (1280, 800),
    ) -> None:
        self.session = session
        self.message = HINTS["look"]
        self.files = {"sculpt": str(sculpt_file), "mesh": str(mesh_file), "viewpoints": str(viewpoints_file)}
        self._ps: Any = window(headless)
        self._gui: Any = require("polyscope.imgui", extra="viewer")
        self._ps.set_window_size(*size)
        self._ps.set_up_dir(f"{up}_up")
        self._ps.remove_all_structures()
        self._ps.set_user_callback(self.frame)
        if cut is not None:
            session.plane = Plane("xyz".index(cut), session.plane.place)
        # What is to be seen at first: the points, and where the field is shown.
        shown = session.points if cut is None else np.concatenate([session.points, session.cut(2)[0]])
        self.picture = Picture(self._ps, session, stand(self._ps, shown, up, size))
        self.picture.open = cut is not None
        self.picture.draw()

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
        self.picture.draw()

    def pick(self, x: float, y: float) -> None:
        """Do what a click does at a place of the window, in pixels from its upper left corner."""
        hit = self._ps.pick(screen_coords=(x, y))
        if not hit.is_hit or self.session.mode == "look":
            return
        normal = None
        if hit.structure_name == "proxy":
            vertices, faces = self.picture.proxy
            a, b, c = vertices[faces[hit.structure_data["index"]]]
            normal = np.cross(b - a, c - a)
            normal = normal / max(float(np.linalg.norm(normal)), 1e-300)
        with self._reporting():
            made = self.session.click(hit.position, normal)
            self.message = "; ".join(map(_describe, made)) or f"{len(self.session.viewpoints)} sensors"

    def _panel(self) -> None:
        gui, session = self._gui, self.session
        for mode in MODES:
            if gui.RadioButton(mode, session.mode == mode):
                session.mode = mode
                self.message = HINTS[mode]
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
        if gui.Button("show surface"):
            with self._reporting():
                self.message = f"{self.picture.draw_surface():,} triangles"
        moved, place = gui.SliderFloat("field at", session.plane.place, 0.0, 1.0)
        turned, axis = gui.Combo("field across", session.plane.axis, ["x", "y", "z"])
        if moved or turned:
            session.plane = Plane(axis, place)
            self._ps.get_surface_mesh("field").set_enabled(True)
        _, self.picture.open = gui.Checkbox("cut open", self.picture.open)
        gui.SameLine()
        gui.SetNextItemWidth(FILTER_WIDTH)
        _, self.picture.filtered = gui.SliderFloat("before | after filter", self.picture.filtered, 0.0, 1.0, "%.2f")
        saves = {"sculpt": session.save_sculpt, "mesh": session.save_mesh}
        if session.mode == "sensor":
            saves["viewpoints"] = session.save_viewpoints
        for name, save in saves.items():
            if gui.Button(f"save {name}"):
                with self._reporting():
                    save(Path(self.files[name]))
                    self.message = f"{self.files[name]} is saved"
            gui.SameLine()
            _, self.files[name] = gui.InputText(f"##{name} file", self.files[name])
        for name, colour in self.picture.legend:
            gui.TextColored((*colour, 1.0), "\u25cf")
            gui.SameLine()
            gui.TextUnformatted(name)
            gui.SameLine()
        gui.NewLine()
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
