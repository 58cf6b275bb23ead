"""Pictures of a cloud, its normals and its surface, drawn without a display (extra ``plot``)."""

from face_plugin.app.plot.curves import plot_curves
from face_plugin.app.plot.figures import PLOT_SUFFIXES, save_figure
from face_plugin.app.plot.interior import plot_interior, space_reached
from face_plugin.app.plot.render import Camera, render_mesh, render_points
from face_plugin.app.plot.result import field_within, plot_result

__all__ = [
    "PLOT_SUFFIXES",
    "Camera",
    "field_within",
    "plot_curves",
    "plot_interior",
    "plot_result",
    "render_mesh",
    "render_points",
    "save_figure",
    "space_reached",
]
