"""A solved cage that is kept: its field, normals and interior, and what is made of it by hand."""

from __future__ import annotations

import dataclasses
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin import cloud
from face_plugin.execution import Execution
from face_plugin.faraday import field
from face_plugin.faraday.locate_plane import AnyLocator, locator_of
from face_plugin.method import solve_field
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.params import Params, settled
from face_plugin.plane import refuse_in_plane
from face_plugin.reading import Reading
from face_plugin.result import Result
from face_plugin.sculpt.file import SculptFile
from face_plugin.sculpt.sculptable import Sculptable
from face_plugin.sculpt.sculptor import Sculptor
from face_plugin.sides.given import checked_trust, given_lines, sides_of_lines
from face_plugin.sides.sensors import Sensors
from face_plugin.sides.sights import lit
from face_plugin.sides.strays import find_strays, without
from face_plugin.stages import Clock, Progress

__all__ = ["FaCE"]


class FaCE(Sculptable):
    """The solved cage: keeps the mesh, the factorisation and the field, and answers questions about them.

    Parameters
    ----------
    points : (n, 3) array_like of float or int, in any unit; or (n, 2) in the plane
    params : Params, optional
    sensors : Sensors, optional
        Where sensors stood: normals then point to what they saw.
    execution : Execution, optional
        Its `max_memory` bounds the mesh; a `FaCE` is always one piece.
    progress : callable, optional
        ``progress(stage, fraction)``.

    Attributes
    ----------
    params : Params
    execution : Execution
    timings : dict of str to float
        Seconds by stage.
    sensors : Sensors or None
        Where they stood, in the unit of the input.
    strays : (n,) bool
        Input points that lie too far from everything to take part.
    frame : Frame
        The way between the coordinates of the input, which methods take and return unless they say otherwise, and the
        canonical frame, which all that follows is in.
    cloud : Cloud
        The distinct points.
    balls : Balls
    mesh : CageMesh
    poisson : Poisson
    vertex_strength : (m,) float64
        E_max at the vertices of the mesh, which is the same in both.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> ball = sphere(500)
    >>> face = FaCE(ball.points)
    >>> bool(((face.normals() * ball.normals).sum(axis=1) > 0).all())
    True
    """

    def __init__(
        self,
        points: ArrayLike,
        params: Params | None = None,
        *,
        sensors: Sensors | None = None,
        execution: Execution | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.params, self.execution = settled(params, execution)
        refuse_in_plane(points, sensors=sensors)
        clock = Clock(progress)
        self.timings = clock.seconds
        with clock("cloud"):
            self.cloud = cloud.prepare(points)
            around = Neighbourhood(self.cloud.points)
        # Points too far from everything take no part.
        with clock("strays"):
            stray = find_strays(around)
            self.strays = stray[self.cloud.rows]
            if stray.any():
                self.cloud = without(self.cloud, points, self.strays)
                around = Neighbourhood(self.cloud.points)
        self.frame = self.cloud.frame
        solved = solve_field(around, self.params, self.frame.scale, memory=self.execution.memory, stage=clock)
        self.balls, self.mesh, self.poisson = solved.cage.balls, solved.cage.mesh, solved.cage.poisson
        strength_of = partial(field.strength, self.mesh, directions=self.params.directions)
        self._sculptor = Sculptor(
            self.mesh, self.poisson, self.balls, self.cloud, solved.cage.potential, solved.strength, strength_of
        )
        plane = self.cloud.plane_normal() if self.cloud.flat else None
        self.sensors = sensors
        local = None if sensors is None else sensors.in_frame(self.frame, self.cloud.rows)
        self._reading = Reading(solved.cage, around, solved.sheets, plane, self.params, solved.strength, clock, local)

    def _follow(self) -> None:
        local = None if self.sensors is None else self.sensors.in_frame(self.frame, self.cloud.rows)
        strength = self._sculptor.strength
        self._reading = dataclasses.replace(self._reading, params=self.params, strength=strength, sensors=local)

    def seen_by(self, sensors: Sensors | None) -> FaCE:
        """Return a copy that other sensors saw; nothing is solved again.

        Examples
        --------
        >>> from face_plugin.shapes import sphere
        >>> ball = sphere(500)
        >>> hollow = FaCE(ball.points).seen_by(Sensors([[0.0, 0.0, 0.0]]))
        >>> bool(((hollow.normals() * ball.normals).sum(axis=1) < 0).all())
        True
        """
        refuse_in_plane(self.cloud.points, sensors=sensors)
        twin = self.sculpted(SculptFile())
        twin.sensors = sensors
        twin._follow()
        return twin

    @property
    def looked_at(self) -> NDArray[np.bool_] | None:
        """Which input points (n,) a sensor saw; None without sensors."""
        seen = None if self.sensors is None else self._reading.looked_at
        return None if seen is None else seen[self.cloud.rows] & ~self.strays

    def lit(self, query: ArrayLike) -> NDArray[np.bool_]:
        """Which positions (k, 3), in the unit of the input, a sensor sees past the points; none without sensors."""
        local = self.frame.to_unit(cloud.as_points(query, "query", (self.cloud.dimension,)))
        return lit(self._reading.around, self._reading.sensors, local)

    @property
    def vertex_strength(self) -> NDArray[np.float64]:
        """E_max (m,) at the vertices of the mesh."""
        return self._sculptor.strength

    def normals(self) -> NDArray[np.floating]:
        """Outward unit normals (n, d) of the input points, in their order and floating-point type."""
        return self.frame.unrotate(self._reading.normals)[self.cloud.rows].astype(self.cloud.dtype)

    def oriented(self, normals: ArrayLike, trusted: ArrayLike | None = None) -> NDArray[np.floating]:
        """Turn the signs of normals (n, d) that are given, as `face_plugin.orient_normals` does."""
        given, lines = given_lines(normals, self.cloud.size, self.cloud.dimension)
        trust, rows, lines = checked_trust(trusted, self.cloud.size), self.cloud.rows, self.frame.rotate(lines)
        reading = self._reading
        # What a sensor saw is certain, whatever the field says.
        sure = reading.agreement if reading.sights is None else np.where(reading.sights.any(1), 1, reading.agreement)
        evidence = np.einsum("nd,nd->n", lines, reading.normals[rows]) * np.where(self.strays, 0.0, sure[rows])
        side = sides_of_lines(reading.around, rows, lines, evidence, trust)
        return np.where(side[:, None] < 0, -given, given)

    def potential(self) -> NDArray[np.float64]:
        """Potentials (m, d) at the vertices of the mesh: column k is that of a unit field along canonical axis k.

        Of a field whose strength is 1 in the unit of the canonical frame.
        """
        return self._sculptor.potential

    def strength(self, query: ArrayLike) -> NDArray[np.float64]:
        """E_max at any position, by linear interpolation between the vertices of the mesh.

        Parameters
        ----------
        query : (k, d) array_like, in the unit of the input

        Returns
        -------
        (k,) float64
            Inside a ball, the mean of its cage vertices; outside the box, 1, the strength of unshielded space.
        """
        local = self.frame.to_unit(cloud.as_points(query, "query", (self.cloud.dimension,)))
        return self.locator.interpolate(local, self.vertex_strength, outside=1.0)

    @cached_property
    def locator(self) -> AnyLocator:
        """Interpolation of any values at the vertices of the mesh, for positions in the canonical frame."""
        return locator_of(self.mesh)

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
        return self._reading.interior(alpha)[self.cloud.rows] & ~self.strays

    @property
    def open(self) -> NDArray[np.bool_]:
        """Which input points (n,) are of parts that enclose nothing, as `Result.open` has it."""
        return self._reading.open[self.cloud.rows]

    def result(self, *, filter_interior: bool = False) -> Result:
        """Everything that is known of the input points."""
        dtype, rows, params = self.cloud.dtype, self.cloud.rows, self.params
        if filter_interior:
            params = dataclasses.replace(params, alpha=self._reading.threshold(params.alpha))
        return Result(
            normals=self.normals(),
            strength=self._reading.seen.strength[rows].astype(dtype),
            confidence=np.where(self.strays, 0.0, self._reading.confidence[rows]).astype(dtype),
            strays=self.strays,
            open=self.open,
            sides=self._reading.sides[rows],
            interior=self.interior() if filter_interior else None,
            timings=dict(self.timings),
            params=params,
        )
