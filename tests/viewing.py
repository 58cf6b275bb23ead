"""A viewer without a window, and a mouse for it."""

from __future__ import annotations

import numpy as np
import polyscope
import polyscope.imgui as imgui
from PIL import Image

from face_plugin.app.viewer.window import Viewer

SIZE = (900, 700)


class Spy:
    """The real imgui, which also remembers where each widget was drawn."""

    def __init__(self):
        self.boxes = {}

    def __getattr__(self, name):
        real = getattr(imgui, name)
        if name not in ("Button", "Checkbox", "RadioButton", "SliderFloat", "Combo", "InputText"):
            return real

        def drawn(label, *args):
            out = real(label, *args)
            self.boxes[label] = *imgui.GetItemRectMin(), *imgui.GetItemRectMax()
            return out

        return drawn


class Hand:
    """A viewer without a window, and a mouse for it: events that go through imgui as a person's do."""

    def __init__(self, session, tmp_path):
        files = {"sculpt_file": tmp_path / "edits.json", "mesh_file": tmp_path / "mesh.ply"}
        files["viewpoints_file"] = tmp_path / "views.csv"
        self.viewer = Viewer(session, headless=True, size=SIZE, **files)
        self.viewer._gui = self.spy = Spy()
        # Peeling layer after layer takes a software renderer long, and changes no click.
        polyscope.set_transparency_mode("simple")
        # Two tests may click on one place within the time of a double click.
        imgui.GetIO().MouseDoubleClickTime = 0.0
        self.move(2, 2)

    def move(self, x, y):
        imgui.GetIO().AddMousePosEvent(x, y)
        self.frames(1)

    def button(self, down):
        imgui.GetIO().AddMouseButtonEvent(0, down)
        self.frames(1)

    def frames(self, count):
        for _ in range(count):
            polyscope.frame_tick()

    def click(self, x, y):
        self.move(x, y)
        self.button(True)
        self.button(False)

    def press(self, label, across=0.1):
        """Click on a widget, at a fraction of its width; that of a slider has its label at the right end."""
        left, top, right, bottom = self.spy.boxes[label]
        self.click(left + across * (right - left), 0.5 * (top + bottom))

    def picture(self, path):
        polyscope.set_transparency_mode("pretty")
        self.viewer.screenshot(path)
        polyscope.set_transparency_mode("simple")
        return np.asarray(Image.open(path).convert("RGB")).astype(float)


def yellow(picture):
    """Number of pixels that may belong to a charge."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((red > blue + 80) & (green > blue + 50)).sum())


def green(picture):
    """Number of pixels that may belong to a cage point."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((green > 1.4 * red) & (green > 1.2 * blue) & (green > 60)).sum())


def look(camera, target):
    """Put the camera somewhere; not straight above, for the turntable has no up there."""
    polyscope.look_at_dir(camera, target, (0.0, 0.0, 1.0))


def look_into_the_mug():
    look((1.2, -1.2, 4.2), (0.0, 0.0, 0.9))
