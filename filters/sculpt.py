"""Charges and cage points from a file as a step."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, ClassVar

from face_plugin.estimate import solve_whole
from face_plugin.execution import Execution
from face_plugin.filters.base import Filter
from face_plugin.filters.pointset import PointSet
from face_plugin.params import Params
from face_plugin.solver import FaCE
from face_plugin.stages import Progress

__all__ = ["Sculpt", "sculpted"]


@dataclass(frozen=True)
class Sculpt(Filter):
    """Apply a sculpt file to the cage, for the normals and the interior test that follow.

    Parameters
    ----------
    file : str
        A JSON file of `face_plugin.sculpt.SculptFile`; in a chain's file, relative to its folder.
    params : Params, optional
        By default those of the cage solved so far, or the package's. A later step with other ones solves
        anew and has no edits.
    execution : Execution, optional
        Where a cage is solved: with how much memory.

    Examples
    --------
    >>> import tempfile
    >>> from face_plugin.filters import Chain, Normals, PointSet
    >>> from face_plugin.sculpt import SculptFile
    >>> from face_plugin.shapes import spherical_shell
    >>> path = tempfile.mkdtemp() + "/cavity.json"
    >>> SculptFile(charges=((0.0, 0.0, 0.0),)).save(path)
    >>> shell = spherical_shell(1500)
    >>> layer = Chain([Sculpt(path), Normals()])(PointSet(shell.points))
    >>> bool(((layer.normals * shell.normals).sum(axis=1) > 0).mean() > 0.99)
    True
    """

    name: ClassVar[str] = "sculpt"
    file: str
    params: Params | None = None
    execution: Execution | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.file, str) or not self.file:
            raise ValueError(f"file must be the path of a sculpt file, found {self.file!r}")

    def __call__(self, layer: PointSet, *, progress: Progress | None = None) -> PointSet:
        """Return `layer` with the sculpted cage; the one that it had stays as it was.

        Raises
        ------
        ValueError
            The file is not a sculpt, or an edit is refused.
        OSError
            The file cannot be read.
        """
        cage = layer.solved(self.params, progress, execution=self.execution)
        if not isinstance(cage, FaCE):
            # Edits need the one mesh that they are made in, whatever its size.
            cage = solve_whole(
                layer.points[layer.keep],
                cage.params,
                purpose="sculpting",
                sensors=layer.sensors_of_kept(),
                execution=cage.execution,
                progress=progress,
            )
        return layer.replace(cage=cage.sculpted(self.file))


def sculpted(layer: PointSet, file: str | os.PathLike[str] | None, **settings: Any) -> PointSet:
    """Return `layer` with the edits of a sculpt file; as it is where that is None. For adapters.

    `settings` are the `params` and `execution` of `Sculpt`.

    Examples
    --------
    >>> import numpy as np
    >>> layer = PointSet(np.eye(3))
    >>> sculpted(layer, None) is layer
    True
    """
    return layer if file is None else Sculpt(os.fspath(file), **settings)(layer)
