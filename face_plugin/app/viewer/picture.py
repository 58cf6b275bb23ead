"""What the window shows: points, normals, proxy, field, edits and sensors, each drawn anew when it has changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.app.viewer.session import Session
from face_plugin.app.viewer.viewport import knife

__all__ = ["Picture"]

# Limits of the colours of log10 E_max.
DECADES = (-4.0, 0.0)
# Radius of a point, and length and radius of its normal, in radii of a ball: what is behind shows between them.
POINT, ARROW = 0.45, (2.0, 0.12)
# Radius of what was put there by hand, relative to the diagonal of the points.
MARK = 0.01
SIDE, INSIDE, PROXY = (0.45, 0.6, 0.8), (0.85, 0.3, 0.25), (0.95, 0.8, 0.55)
SEEN = (0.55, 0.75, 0.35)
NORMAL = (0.3, 0.3, 0.35)
CHARGE, SHIELD, SENSOR, MESH = (1.0, 0.75, 0.0), (0.1, 0.6, 0.2), (0.75, 0.2, 0.75), (0.8, 0.8, 0.78)


class Picture:
    """Polyscope's structures of a `Session`.

    Parameters
    ----------
    ps
        What `face_plugin.app.viewer.viewport.window` returned.
    session : Session
    scale : float
        Length in which polyscope counts radii.

    Attributes
    ----------
    open : bool
        Whether the object is cut open at the session's plane.
    filtered : float
        Up to where along its longest axis points inside are left out, as a fraction of the extent: 0 shows the points
        before the filter, 1 after it.

    Examples
    --------
    >>> import numpy as np
    >>> from face_plugin.app.viewer.viewport import stand, window
    >>> from face_plugin.shapes import sphere
    >>> ps, session = window(headless=True), Session(sphere(200).points)
    >>> picture = Picture(ps, session, stand(ps, session.points, "z", (320, 240)))
    >>> picture.draw()
    >>> ps.get_point_cloud("points").n_points()
    200
    """

    def __init__(self, ps: Any, session: Session, scale: float) -> None:
        self.session = session
        self.open = False
        self.filtered = 0.0
        self.proxy: tuple[NDArray[np.float64], NDArray[np.int64]] = np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
        self._ps, self._scale = ps, scale
        self._knife: Any = knife(ps)
        self._drawn: dict[str, tuple[Any, ...]] = {}
        self._inside: NDArray[np.bool_] = np.zeros(len(session.points), dtype=np.bool_)
        axis = int(np.argmax(np.ptp(session.points, axis=0)))
        along = session.points[:, axis].astype(np.float64)
        self._along = (along - along.min()) / max(float(np.ptp(along)), np.finfo(float).tiny)

    def draw(self) -> None:
        """Bring the picture up to date; what has not changed is left alone."""
        face, alpha, plane = self.session.face, self.session.alpha, self.session.plane
        # An edit is to be seen at once: which points are interior takes longer, and is told one frame later.
        if not self._update("points", (face, self.filtered), self._draw_points):
            self._update("interior", (face, alpha, self.session.automatic), self._draw_interior)
        self._update("proxy", (face, alpha), self._draw_proxy)
        self._update("field", (face, plane), self._draw_field)
        self._update("sensors", (face,), self._draw_sensors)
        self._update("knife", (plane, self.open), self._place_knife)
        self._update("edits", (face,), self._draw_edits)
        # A surface that does not go with the points any more would mislead.
        if self._drawn.get("surface") not in (None, (face, alpha, self.session.automatic)):
            self._ps.remove_surface_mesh("surface", error_if_absent=False)
            del self._drawn["surface"]

    def draw_surface(self) -> int:
        """Draw the Poisson surface of the points kept, until one of them changes; return the number of triangles."""
        vertices, faces = self.session.surface()
        self._ps.register_surface_mesh("surface", vertices, faces, color=MESH, smooth_shade=True)
        self._drawn["surface"] = self.session.face, self.session.alpha, self.session.automatic
        return len(faces)

    @property
    def legend(self) -> list[tuple[str, tuple[float, float, float]]]:
        """Name and colour of what is to be seen."""
        session, edits = self.session, {edit.kind for edit in self.session.face.edits}
        seen = session.lit()
        there = {
            ("outside", SIDE): True,
            ("seen", SEEN): seen is not None,
            ("inside", INSIDE): bool(self._inside.any()),
            ("proxy", PROXY): len(self.proxy[1]) > 0,
            ("charge", CHARGE): "charge" in edits,
            ("cage point", SHIELD): "cage" in edits,
            ("sensor", SENSOR): seen is not None,
        }
        return [entry for entry, is_there in there.items() if is_there]

    def _update(self, name: str, state: tuple[Any, ...], draw: Callable[[], None]) -> bool:
        """Draw if the state is another than at the last time, and tell whether it was."""
        # The states are compared by identity: equal arrays in another cage are another drawing.
        known = self._drawn.get(name, ())
        if len(known) == len(state) and all(a is b or a == b for a, b in zip(known, state, strict=True)):
            return False
        self._drawn[name] = state
        draw()
        return True

    def _draw_points(self) -> None:
        session, shown = self.session, ~(self._inside & (self._along < self.filtered))
        cloud = self._ps.register_point_cloud("points", session.points[shown])
        size = float(np.median(session.face.balls.radii)) * session.face.frame.scale
        cloud.set_radius(POINT * size, relative=False)
        length, radius = ARROW
        cloud.add_vector_quantity(
            "normals",
            length * size * session.face.normals()[shown],
            enabled=True,
            vectortype="ambient",
            radius=radius * size / self._scale,
            color=NORMAL,
        )
        seen = session.lit()
        colours = np.where(self._inside[:, None], INSIDE, SIDE)
        if seen is not None:
            colours[seen] = SEEN
        cloud.add_color_quantity("interior", colours[shown], enabled=True)

    def _draw_interior(self) -> None:
        self._inside = self.session.interior()
        self._draw_points()

    def _draw_proxy(self) -> None:
        self.proxy = vertices, faces = self.session.proxy()
        if len(faces) == 0:
            self._ps.remove_surface_mesh("proxy", error_if_absent=False)
        else:
            mesh = self._ps.register_surface_mesh("proxy", vertices, faces, color=PROXY, transparency=0.5)
            # A click is to hit a face: vertices and edges have no side.
            mesh.set_selection_mode("faces_only")

    def _draw_field(self) -> None:
        vertices, quads, strength = self.session.cut()
        mesh = self._ps.register_surface_mesh("field", vertices, quads, enabled=self._enabled("field"))
        decades = np.log10(np.maximum(strength, 10.0 ** DECADES[0]))
        mesh.add_scalar_quantity("log10 E_max", decades, enabled=True, vminmax=DECADES, cmap="viridis")
        lit = self.session.lit_places(vertices)
        if lit is not None:
            mesh.add_color_quantity("seen", np.where(lit[:, None], SEEN, MESH), enabled=True)
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
            self._draw_marks(name, [edit.places for edit in self.session.face.edits if edit.kind == kind], colour)

    def _draw_sensors(self) -> None:
        self._draw_marks("sensors", list(self.session.viewpoints[:, None]), SENSOR)

    def _draw_marks(self, name: str, places: list[NDArray[np.float64]], colour: tuple[float, float, float]) -> None:
        if places:
            cloud = self._ps.register_point_cloud(name, np.concatenate(places), radius=MARK, color=colour)
            cloud.set_ignore_slice_plane(self._knife, True)
        else:
            self._ps.remove_point_cloud(name, error_if_absent=False)

    def _enabled(self, name: str) -> bool:
        """Whether the user has the mesh of that name switched on; at first it is off."""
        return bool(self._ps.has_surface_mesh(name) and self._ps.get_surface_mesh(name).is_enabled())
