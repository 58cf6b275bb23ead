"""Our filters: their names and parameters, and what each does to a layer."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from face_plugin.adapters.pymeshlab import layer as layers
from face_plugin.adapters.pymeshlab.parameters import Parameter, common_parameters, settings_in
from face_plugin.filters import Chain, Filter, Interior, Normals, PointSet, Reconstruct
from face_plugin.trimming import TrimDistance

__all__ = ["FILTERS", "MeshLabFilter", "Values", "python_name"]

Values = Mapping[str, Any]
NO_TRIM = -1.0


@dataclass(frozen=True)
class MeshLabFilter:
    """A filter with its parameters."""

    title: str
    """Name in MeshLab's menus and scripts; PyMeshLab's is the same in lower case with underscores."""
    run: Callable[[Any, PointSet, Values], None]
    own: tuple[Parameter, ...] = ()
    transformed: bool = False
    """Whether it works in the coordinates of the scene, as MeshLab's reconstructions do."""

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The filter's own parameters, and then those of the method."""
        return {parameter.name: parameter for parameter in (*self.own, *_SHARED, *common_parameters())}


def _normals(ms: Any, layer: PointSet, values: Values) -> None:
    normals = Normals(**settings_in(values))(layer).normals
    assert normals is not None  # the step gives them
    layers.write_normals(ms, normals, values["onselected"])


def _interior(ms: Any, layer: PointSet, values: Values) -> None:
    layers.write_selection(ms, Interior(**settings_in(values))(layer).attributes["interior"])


def _strength(ms: Any, layer: PointSet, values: Values) -> None:
    strength = Normals(**settings_in(values))(layer).attributes["strength"]
    layers.write_scalar(ms, strength, values["onselected"])


def _surface(ms: Any, layer: PointSet, values: Values) -> None:
    middle: list[Filter] = [Interior()] if values["filter_interior"] else []
    # MeshLab's numbers cannot be a word or nothing.
    distance: TrimDistance = values["trim_distance"] or "auto"
    last = Reconstruct(
        values["depth"], values["screened"], "pymeshlab", trim_distance=None if distance == NO_TRIM else distance
    )
    surface = Chain([Normals(**settings_in(values)), *middle, last])(layer).surface
    assert surface is not None  # the chain ends with it
    layers.add_surface(ms, surface.vertices, surface.faces, "Faraday mesh")


_SHARED = (
    # The names of MeshLab's own filter for the normals of point clouds.
    Parameter("flipflag", "bool", False, "Turn the normals to what is seen from the viewpoint"),
    Parameter("viewpos", "position", (0.0, 0.0, 0.0), "Position of the viewpoint (the scanner)"),
    Parameter("sculpt", "str", "", "File of charges and cage points (JSON); empty: none"),
)
_ONSELECTED = Parameter("onselected", "bool", False, "Change the selected vertices only; all conduct")
_TABLE = (
    MeshLabFilter("Compute Normal by Faraday Cage", _normals, (_ONSELECTED,)),
    MeshLabFilter("Compute Selection by Faraday Interior", _interior),
    MeshLabFilter("Compute Scalar by Faraday Strength", _strength, (_ONSELECTED,)),
    MeshLabFilter(
        "Generate Surface Reconstruction Faraday",
        _surface,
        (
            Parameter("depth", "int", 8, "Depth of the octree of the reconstruction"),
            Parameter("screened", "bool", True, "Screened reconstruction, or the smoother unscreened one"),
            Parameter("filter_interior", "bool", True, "Leave out the points inside the object"),
            Parameter(
                "trim_distance",
                "float",
                0.0,
                "Spacings from the points beyond which the surface is cut; 0 = 2 where the scan is open; -1 = no cut",
            ),
        ),
        transformed=True,
    ),
)


def python_name(title: str) -> str:
    """Name of a filter in PyMeshLab from its name in MeshLab."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")


FILTERS = {python_name(entry.title): entry for entry in _TABLE}
