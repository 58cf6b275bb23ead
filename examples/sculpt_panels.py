"""Cut-away pictures before and after an edit, for the examples of sculpting."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from panels import aligned, save_panels
from scipy.spatial import cKDTree

from face_plugin.app.plot import Camera, render_mesh, render_points
from face_plugin.shapes import sphere
from face_plugin.surface import poisson_reconstruction

VIEW = (-70.0, 25.0)
RIGHT, WRONG, CHARGE, SHIELD = (0.45, 0.6, 0.8), (0.85, 0.2, 0.15), (1.0, 0.75, 0.0), (0.1, 0.6, 0.2)
BALL = sphere(60).points


class BeforeAfter:
    """Collects two panels a state of the cage: its points, and the surface from those kept; both cut open."""

    def __init__(self, points: Any, truth: Any, *, depth: int = 7) -> None:
        self.points, self.truth, self.depth = points, truth, depth
        self.camera = Camera.around(points, view=VIEW)
        nearest = cKDTree(points).query(points, k=2)[0][:, 1]
        self.radius = 0.3 * float(np.median(nearest))
        self.panels: list[tuple[str, Any]] = []

    def add(self, title: str, face: Any, kept: Any = None) -> None:
        """Draw a state; wrong normals are red, charges yellow and cage points green."""
        kept = np.ones(len(self.points), dtype=bool) if kept is None else kept
        normals = face.normals()
        wrong = (normals * self.truth).sum(axis=1) < 0
        share = aligned(normals[kept], self.truth[kept])
        colours = np.where(wrong[:, None], WRONG, RIGHT)
        behind = kept & (self.points[:, 1] > 0)
        drawn, paint = [self.points[behind]], [colours[behind]]
        for edit in face.edits:
            # Points have one size in a picture: a ball of them for each edit.
            spot = (edit.places[:, None] + 3 * self.radius * BALL).reshape(-1, 3)
            drawn.append(spot)
            paint.append(np.tile(CHARGE if edit.kind == "charge" else SHIELD, (len(spot), 1)))
        picture = render_points(
            np.concatenate(drawn), np.concatenate(paint), radius=self.radius, camera=self.camera, size=500
        )
        self.panels.append((f"{title}: {share:.1f} % aligned", picture))
        vertices, faces, _ = poisson_reconstruction(self.points[kept], normals[kept], depth=self.depth)
        half = vertices[faces].mean(axis=1)[:, 1] > 0
        picture = render_mesh(vertices, faces[half], camera=self.camera, size=500)
        self.panels.append((f"{title}: surface", picture))

    def save(self, path: Path) -> None:
        """Write the panels side by side."""
        path.parent.mkdir(parents=True, exist_ok=True)
        save_panels(path, self.panels)
