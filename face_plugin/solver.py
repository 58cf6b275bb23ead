"""A solved cage that is kept: its field, normals and interior, and what is made of it by hand."""

from __future__ import annotations

import dataclasses
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from face_plugin import cloud
from face_plugin.faraday import domain, field, gradient
from face_plugin.faraday.balls import build_balls
from face_plugin.faraday.inside import shielded
from face_plugin.faraday.locate import Locator
from face_plugin.faraday.meshers.select import build_mesh
from face_plugin.faraday.poisson import Poisson
from face_plugin.geometry import local_spacing, thin
from face_plugin.params import ALPHAS, Params
from face_plugin.refine import refine
from face_plugin.result import Progress, Result
from face_plugin.sculpt.sculptable import Sculptable
from face_plugin.sides import enclosure
from face_plugin.sides.confidence import confidence
from face_plugin.sides.sheets import cage_separation

__all__ = ["FaCE"]

log = logging.getLogger(__name__)


class FaCE(Sculptable):
    """The solved cage: keeps the mesh, the factorisation and the field, and answers questions about them.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit
    params : Params, optional
    progress : callable, optional
        ``progress(stage, fraction)``.

    Attributes
    ----------
    cloud : Cloud
        The distinct points in the canonical frame; `frame` is the way between it and the input.
    balls : Balls
    mesh : CageMesh
    poisson : Poisson
    vertex_strength : (m,) float64
        E_max at the vertices of the mesh.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> face = FaCE(ball.points)
    >>> bool(((face.normals() * ball.normals).sum(axis=1) > 0).all())
    True
    """

    def __init__(self, points: ArrayLike, params: Params | None = None, *, progress: Progress | None = None) -> None:
        self.params = params or Params()
        self.timings: dict[str, float] = {}
        self._progress = progress or (lambda stage, fraction: None)
        self._solve(points)

    def _solve(self, points: ArrayLike) -> None:
        params = self.params
        # 1. Check the points and put them into a canonical frame.
        with self._stage("cloud"):
            self.cloud = cloud.prepare(points)
            self.frame = self.cloud.frame
        # 2. Conducting balls at the points: near-duplicates left out, and points on sheets with nothing else near.
        with self._stage("cage"):
            spacing = None if params.cage_spacing is None else params.cage_spacing / self.frame.scale
            separation, self._sheets = cage_separation(self.cloud.points, spacing, coarsen=params.angles == "refined")
            rows = thin(self.cloud.points, separation, params.seed)
            self.balls = build_balls(
                self.cloud.points, rows, radius=params.ball_radius, solid=params.solid, seed=params.seed
            )
        # 3. A padded box.
        with self._stage("domain"):
            box = domain.padded_box(self.balls, params.padding, params.least_side)
            local = local_spacing(self.balls.centres)
        # 4. Tetrahedra between the box and the balls, graded from these to it.
        with self._stage("mesh"):
            self.mesh = build_mesh(self.balls, local, box, params)
        # 5. Potentials in three basis fields; every other direction is their combination.
        with self._stage("poisson"):
            self.poisson = Poisson(self.mesh, params.solver)
            self._potential = self.poisson.solve(self.mesh.vertices[self.mesh.boundary])
        # 6. The greatest strength that an external field of any direction causes.
        with self._stage("field"):
            self.vertex_strength = self._strength_of(self._potential)

    def _strength_of(self, potential: NDArray[np.float64]) -> NDArray[np.float64]:
        return field.strength(self.mesh, potential, self.params.directions)

    @cached_property
    def _point_strength(self) -> NDArray[np.float64]:
        """E_max at the balls nearest to the distinct points (m,)."""
        ball = cKDTree(self.balls.centres).query(self.cloud.points, workers=-1)[1]
        return np.asarray(gradient.ball_means(self.mesh, self.vertex_strength)[ball])

    @cached_property
    def _field_normals(self) -> NDArray[np.float64]:
        """Gradient of the strength at the distinct points (m, 3), in the canonical frame."""
        at_balls = gradient.field_normals(self.mesh, self.vertex_strength)
        return gradient.carry(self.balls.centres, at_balls, self.cloud.points)

    @cached_property
    def _normals(self) -> NDArray[np.float64]:
        """Normals of the distinct points (m, 3), in the canonical frame."""
        with self._stage("normals"):
            if self.cloud.flat:
                # The field is the same on both sides of a sheet: its mean gradient lies in the sheet.
                return np.tile(self.cloud.plane_normal(), (len(self.cloud.points), 1))
            # 7. The strength grows outward, so its gradient at a ball points outward.
            if self.params.angles == "field":
                return self._field_normals
            # 8. Stray sides turned round, and angles, from the points themselves.
            return refine(self.cloud.points, self._votes, self._point_strength, sheets=self._sheets)

    @cached_property
    def _votes(self) -> NDArray[np.float64]:
        """Field normals (m, 3), zero where there is no field: its gradient there is rounding, and must not spread."""
        return np.where((self._point_strength > gradient.ROUNDING)[:, None], self._field_normals, 0.0)

    @cached_property
    def _enclosed(self) -> NDArray[np.bool_]:
        """Which distinct points (m,) the others enclose."""
        return enclosure.enclosed(self.cloud.points, self._normals, self._point_strength)

    def normals(self) -> NDArray[np.floating]:
        """Outward unit normals (n, 3) of the input points, in their order and floating-point type."""
        return self.frame.unrotate(self._normals)[self.cloud.rows].astype(self.cloud.dtype)

    def potential(self) -> NDArray[np.float64]:
        """Potentials (m, 3) at the vertices of the mesh: column k is that of a unit field along canonical axis k."""
        return self._potential

    def strength(self, query: ArrayLike) -> NDArray[np.float64]:
        """E_max at any position, by linear interpolation between the vertices of the mesh.

        Parameters
        ----------
        query : (k, 3) array_like, in the unit of the input

        Returns
        -------
        (k,) float64
            Inside a ball, the mean of its cage vertices; outside the box, 1, the strength of unshielded space.
        """
        local = self.frame.to_unit(cloud.as_points(query, "query"))
        return self.locator.interpolate(local, self.vertex_strength, outside=1.0)

    @cached_property
    def locator(self) -> Locator:
        """Interpolation of any values at the vertices of the mesh, for positions in the canonical frame."""
        return Locator(self.mesh)

    def interior(self, alpha: float | str | None = None) -> NDArray[np.bool_]:
        """Which input points lie inside the object. Nothing is solved again, whatever alpha.

        Parameters
        ----------
        alpha : float or {"auto", "dense", "sparse"}, optional
            As in `Params.alpha`, which is the default. A number, or a name for the paper's 0.01 and 0.05: the points
            that this isosurface of E_max encloses (paper section 3.5). "auto": those of them that the other points
            enclose as well, with alpha from the leak of the cage; see `face_plugin.sides.enclosure`.

        Returns
        -------
        (n,) bool
        """
        level, enclosed = self._threshold(self.params.alpha if alpha is None else alpha)
        with self._stage("interior"):
            inside = np.ones(len(self.cloud.points), dtype=np.bool_) if enclosed is None else enclosed.copy()
            if inside.any():
                candidates = self.cloud.points[inside]
                inside[inside] = shielded(self.mesh, self.vertex_strength, candidates, level, self.params.inside)
            return inside[self.cloud.rows]

    def _threshold(self, alpha: float | str) -> tuple[float, NDArray[np.bool_] | None]:
        """Alpha as a number and, where it is automatic, which points (m,) are enclosed, as those inside must be."""
        alpha = Params(alpha=alpha).alpha  # type: ignore[arg-type]
        if alpha == "auto":
            return enclosure.automatic_alpha(self._point_strength[self._enclosed]), self._enclosed
        return (ALPHAS[alpha] if isinstance(alpha, str) else alpha), None

    def result(self, *, filter_interior: bool = False) -> Result:
        """Everything that is known of the input points."""
        dtype, rows = self.cloud.dtype, self.cloud.rows
        oriented = self.normals()
        params = self.params
        if filter_interior:
            params = dataclasses.replace(params, alpha=self._threshold(params.alpha)[0])
        return Result(
            normals=oriented,
            strength=self._point_strength[rows].astype(dtype),
            confidence=confidence(self.cloud.points, self._votes, self._normals)[rows].astype(dtype),
            interior=self.interior() if filter_interior else None,
            timings=dict(self.timings),
            params=params,
        )

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        """Time a stage, and report its start and end."""
        self._progress(name, 0.0)
        start = time.perf_counter()
        yield
        self.timings[name] = self.timings.get(name, 0.0) + time.perf_counter() - start
        log.debug("%s: %.3f s", name, self.timings[name])
        self._progress(name, 1.0)
