"""Refinement of a solved cage by hand: charges carve, cage points shield (paper sections 3.1.2 and 3.6)."""

from __future__ import annotations

import copy
import dataclasses
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from operator import index
from typing import Literal, SupportsIndex, TypeVar

from numpy.typing import ArrayLike

from face_plugin.cloud import Cloud
from face_plugin.params import ALPHAS, Params
from face_plugin.plane import refuse_in_plane
from face_plugin.sculpt.file import SculptFile
from face_plugin.sculpt.sculptor import Edit, Sculptor

__all__ = ["Edit", "SculptFile", "Sculptable"]

Solved = TypeVar("Solved", bound="Sculptable")


class Sculptable(ABC):
    """The edits of a `FaCE`; its field, normals and interior follow each of them at once.

    Examples
    --------
    >>> from face_plugin import FaCE
    >>> from face_plugin.shapes import spherical_shell
    >>> shell = spherical_shell(1500)
    >>> face = FaCE(shell.points)
    >>> before = ((face.normals() * shell.normals).sum(axis=1) > 0).mean()
    >>> edit, = face.add_charges([[0.0, 0.0, 0.0]])  # the cavity is empty space
    >>> after = ((face.normals() * shell.normals).sum(axis=1) > 0).mean()
    >>> bool(before < 0.9 < 0.99 < after)
    True
    """

    params: Params
    cloud: Cloud
    _sculptor: Sculptor

    def add_charges(self, positions: ArrayLike, *, alpha: float | None = None) -> tuple[Edit, ...]:
        """Carve: put a point charge at the vertex of the mesh nearest to each position.

        All charges make one more scenario: u = M there, with M five times the largest value on the box, 0 on
        the box, and a floating cage (paper section 3.1.2). Its field strength joins E_max by the maximum.
        Space that a charge lights up counts as outside; a neutral cage shields what is inside from it.

        Parameters
        ----------
        positions : (k, 3) array_like of float, in the coordinates of the input
        alpha : float, optional
            The proxy is the isosurface of E_max at this value, by default that of the settings. A charge near
            the proxy goes to a vertex outside it. One that is put deep inside stays there: this is how a
            closed cavity is told from a body.

        Returns
        -------
        tuple of Edit
            One a position; ``edit.places`` says where it went.

        Raises
        ------
        ValueError
            A position is not finite, inside a ball, or on or outside the box, or `alpha` is not in (0, 1). No
            edit is made then.
        """
        refuse_in_plane(self.cloud.points, charges=positions)
        level = self.proxy_level if alpha is None else float(Params(alpha=alpha).alpha)
        edits = self._sculptor.add_charges(positions, level)
        self._follow()
        return edits

    def add_cage_points(self, positions: ArrayLike, radius: ArrayLike | None = None) -> tuple[Edit, ...]:
        """Shield: let the vertices of the mesh near each position join the conductor (paper section 3.6).

        Parameters
        ----------
        positions : (k, 3) array_like of float, in the coordinates of the input
        radius : float or (k,) array_like of float or None, optional
            How far they reach, in the unit of the input; by default, and where it is None, 0.9 x the distance
            to the nearest input point. Where there is no vertex within it, the nearest one joins.

        Returns
        -------
        tuple of Edit
            One a position; ``edit.places`` are the vertices that joined.

        Raises
        ------
        ValueError
            As `add_charges`; or a radius is not positive, or a charge lies within it. No edit is made then.
        """
        refuse_in_plane(self.cloud.points, cage_points=positions)
        edits = self._sculptor.add_cage_points(positions, radius)
        self._follow()
        return edits

    @property
    def proxy_level(self) -> float:
        """E_max on the proxy, by the settings; "auto" is as "dense"."""
        alpha = self.params.alpha
        return ALPHAS.get(alpha, ALPHAS["dense"]) if isinstance(alpha, str) else alpha

    @property
    def edits(self) -> tuple[Edit, ...]:
        """The edits in the order in which they were made."""
        return tuple(self._sculptor.edits.values())

    def remove_edits(self, edits: Iterable[Edit | SupportsIndex] | Edit | SupportsIndex) -> None:
        """Take edits back, one or several, given as such or by their numbers.

        Raises
        ------
        ValueError
            One of them is not, or no longer, there. None is removed then.
        TypeError
            It is neither an edit nor an integer.
        """
        several = edits if isinstance(edits, Iterable) else (edits,)
        self._sculptor.remove(edit.number if isinstance(edit, Edit) else index(edit) for edit in several)
        self._follow()

    def clear_edits(self) -> None:
        """Take all edits back; the field is then bit by bit what it was before the first."""
        self.remove_edits(self.edits)

    def sculpted(self: Solved, sculpt: SculptFile | str | os.PathLike[str]) -> Solved:
        """Return a copy with further edits, from a file or as one holds them; `self` stays as it is.

        Raises
        ------
        ValueError
            The file is not a sculpt, or an edit is refused.

        Examples
        --------
        >>> from face_plugin import FaCE
        >>> from face_plugin.shapes import spherical_shell
        >>> face = FaCE(spherical_shell(500).points)
        >>> len(face.sculpted(SculptFile(charges=((0.0, 0.0, 0.0),))).edits), len(face.edits)
        (1, 0)
        """
        source = ""
        if not isinstance(sculpt, SculptFile):
            source, sculpt = f"{os.fspath(sculpt)}: ", SculptFile.load(sculpt)
        twin = copy.copy(self)
        twin._sculptor = self._sculptor.copy()
        # Cage points first: a charge is not to be put where they grow to.
        with _naming(f"{source}cage_points: "):
            if sculpt.cage_points:
                places, reaches = zip(*((p.position, p.radius) for p in sculpt.cage_points), strict=True)
                twin.add_cage_points(places, reaches)  # None is a radius too
        with _naming(f"{source}charges: "):
            if sculpt.charges:
                twin.add_charges(sculpt.charges)
        return twin

    def with_angles(self: Solved, angles: Literal["refined", "field"]) -> Solved:
        """Return a copy with the other kind of normals (`Params.angles`); nothing is solved again.

        Examples
        --------
        >>> from face_plugin import FaCE
        >>> from face_plugin.shapes import sphere
        >>> FaCE(sphere(500).points).with_angles("field").params.angles
        'field'
        """
        twin = self.sculpted(SculptFile())
        twin.params = dataclasses.replace(self.params, angles=angles)
        twin._follow()
        return twin

    @abstractmethod
    def _follow(self) -> None:
        """Take over the settings, and the field with its edits."""


@contextmanager
def _naming(where: str) -> Iterator[None]:
    """Put in front of a refusal where the edit stands."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{where}{error}") from error
