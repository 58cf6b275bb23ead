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

from face_plugin import cloud
from face_plugin.faraday import field
from face_plugin.faraday.gradient import FieldAtPoints, field_at_points
from face_plugin.faraday.inside import shielded
from face_plugin.faraday.locate import Locator
from face_plugin.method import orient, solve_field
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.params import Params
from face_plugin.result import Progress, Result
from face_plugin.sculpt.sculptable import Sculptable
from face_plugin.sides import enclosure
from face_plugin.sides.confidence import confidence

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
        with self._stage("cloud"):
            self.cloud = cloud.prepare(points)
            self.frame = self.cloud.frame
        self._around = Neighbourhood(self.cloud.points)
        solved = solve_field(self._around, self.params, self.frame.scale, stage=self._stage)
        self.balls, self.mesh, self.poisson = solved.cage.balls, solved.cage.mesh, solved.cage.poisson
        self._potential, self.vertex_strength, self._sheets = solved.cage.potential, solved.strength, solved.sheets

    def _strength_of(self, potential: NDArray[np.float64]) -> NDArray[np.float64]:
        return field.strength(self.mesh, potential, self.params.directions)

    @cached_property
    def _seen(self) -> FieldAtPoints:
        """What the field says of the distinct points."""
        return field_at_points(self.mesh, self.vertex_strength, self.balls, self.cloud.points)

    @cached_property
    def _normals(self) -> NDArray[np.float64]:
        """Normals of the distinct points (m, 3), in the canonical frame."""
        with self._stage("normals"):
            plane = self.cloud.plane_normal() if self.cloud.flat else None
            return orient(self._around, self._seen, self.params, plane=plane, sheets=self._sheets)

    @cached_property
    def _enclosed(self) -> NDArray[np.bool_]:
        """Which distinct points (m,) the others enclose."""
        return enclosure.enclosed(self._around, self._normals, self._seen.strength)

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
        alpha = Params(alpha=self.params.alpha if alpha is None else alpha).alpha  # type: ignore[arg-type]
        level = self._threshold(alpha)
        with self._stage("interior"):
            # What alpha is derived from decides as well.
            inside = self._enclosed.copy() if alpha == "auto" else np.ones(len(self.cloud.points), dtype=np.bool_)
            if inside.any():
                candidates = self.cloud.points[inside]
                inside[inside] = shielded(self.mesh, self.vertex_strength, candidates, level, self.params.inside)
            return inside[self.cloud.rows]

    def _threshold(self, alpha: float | str) -> float:
        return enclosure.threshold(alpha, lambda: self._seen.strength[self._enclosed])

    def result(self, *, filter_interior: bool = False) -> Result:
        """Everything that is known of the input points."""
        dtype, rows = self.cloud.dtype, self.cloud.rows
        oriented = self.normals()
        params = self.params
        if filter_interior:
            params = dataclasses.replace(params, alpha=self._threshold(params.alpha))
        return Result(
            normals=oriented,
            strength=self._seen.strength[rows].astype(dtype),
            confidence=confidence(self._around, self._seen.votes, self._normals)[rows].astype(dtype),
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
