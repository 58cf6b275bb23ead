"""PDAL: functions for ``filters.python``, which calls them with dictionaries of one array a dimension.

In a pipeline::

    {"type": "filters.python", "module": "face", "function": "estimate_normals",
     "source": "from face_plugin.adapters.pdal import estimate_normals",
     "add_dimension": ["NormalX", "NormalY", "NormalZ"]}

Settings, since PDAL passes none to a function that is imported::

    "source": "import face_plugin.adapters.pdal as face; step = face.configured(always_up=True, cage_spacing=0.5)"
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, MutableMapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from face_plugin.filters import Chain, Filter, Interior, Normals, PointSet
from face_plugin.params import settings_of
from face_plugin.sides.sensors import Sensors, sensors_of

__all__ = ["configured", "estimate_normals", "remove_interior"]

Dimensions = Mapping[str, NDArray[Any]]
NORMAL = ("NormalX", "NormalY", "NormalZ")


def estimate_normals(ins: Dimensions, outs: MutableMapping[str, NDArray[Any]]) -> bool:
    """Write outward unit normals to NormalX, NormalY and NormalZ.

    Parameters
    ----------
    ins, outs : dict of str to (n,) array
        As ``filters.python`` passes them. The stage needs ``"add_dimension": ["NormalX", "NormalY",
        "NormalZ"]`` where the points have no normals yet.

    Returns
    -------
    bool
        True, which tells PDAL that all is well.

    Raises
    ------
    ValueError
        A dimension is missing, or the points are not finite or too few; PDAL stops with the message.

    Examples
    --------
    >>> from face_plugin.shapes import sphere
    >>> x, y, z = sphere(300).points.T
    >>> zero = {name: x * 0 for name in NORMAL}
    >>> outs = {}
    >>> estimate_normals({"X": x, "Y": y, "Z": z, **zero}, outs), sorted(outs)
    (True, ['NormalX', 'NormalY', 'NormalZ'])
    """
    return _run(ins, outs, Normals())


def remove_interior(ins: Dimensions, outs: MutableMapping[str, NDArray[Any]]) -> bool:
    """Drop the points inside the object, by PDAL's output dimension Mask; the others keep all they have.

    Parameters and errors are those of `estimate_normals`; no dimension has to be added.

    Examples
    --------
    >>> from face_plugin.shapes import nested_box
    >>> x, y, z = nested_box(900).points.T
    >>> outs = {}
    >>> remove_interior({"X": x, "Y": y, "Z": z}, outs), list(outs)
    (True, ['Mask'])
    """
    return _run(ins, outs, Interior())


def configured(
    *,
    normals: bool = True,
    interior: bool = False,
    viewpoint: str | ArrayLike | None = None,
    always_up: bool = False,
    **settings: Any,
) -> Callable[[Dimensions, MutableMapping[str, NDArray[Any]]], bool]:
    """Make a function for ``filters.python`` with other settings.

    Parameters
    ----------
    normals : bool
        Write normals.
    interior : bool
        Drop interior points and strays.
    viewpoint : str or (3,) or (k, 3) array_like, optional
        Where the scanner stood, as of PDAL's ``filters.normal``: a point in WKT or GeoJSON, or an array of one or more.
    always_up : bool
        All was seen from above, as in most aerial scans; unlike ``filters.normal`` not by default.
    **settings
        Fields of `face_plugin.Params` and `face_plugin.Execution`.

    Examples
    --------
    >>> step = configured(interior=True, alpha="sparse")
    """
    given, sensors = settings_of(settings), sensors_of(_position(viewpoint), None, (0, 0, 1) if always_up else None)
    steps: list[Filter] = [Normals(**given)] if normals else []
    chain = Chain([*steps, Interior(**given)] if interior else steps)

    def step(ins: Dimensions, outs: MutableMapping[str, NDArray[Any]]) -> bool:
        return _run(ins, outs, chain, sensors)

    return step


def _position(viewpoint: str | ArrayLike | None) -> ArrayLike | None:
    """Coordinates of a point in WKT or GeoJSON; anything else as it is."""
    if not isinstance(viewpoint, str):
        return viewpoint
    found = re.fullmatch(r"\s*POINT\s*Z?\s*\(([^()]+)\)\s*", viewpoint, re.IGNORECASE)
    try:
        numbers = [float(word) for word in found[1].split()] if found else json.loads(viewpoint)["coordinates"]
    except (ValueError, KeyError, TypeError):
        numbers = []
    if len(numbers) != 3:
        raise ValueError(f"viewpoint must be a point with x, y and z, such as 'POINT Z (1 2 3)', found {viewpoint!r}")
    return np.asarray(numbers)


def _run(
    ins: Dimensions, outs: MutableMapping[str, NDArray[Any]], step: Filter, sensors: Sensors | None = None
) -> bool:
    for name in "XYZ":
        if name not in ins:
            raise ValueError(f"ins must hold the dimensions X, Y and Z, found {', '.join(ins)}")
    layer = step(PointSet(np.stack([ins[name] for name in "XYZ"], axis=1), sensors=sensors))
    if layer.normals is not None:
        for axis, name in enumerate(NORMAL):
            if name not in ins:
                # PDAL ignores what is written to a dimension that it does not have.
                raise ValueError(f"there is no dimension {name}: add_dimension must list {', '.join(NORMAL)}")
            # PDAL reads the memory of the array: it must be contiguous and of the dimension's own type.
            outs[name] = np.ascontiguousarray(layer.normals[:, axis], dtype=ins[name].dtype)
    if not layer.keep.all():
        outs["Mask"] = np.array(layer.keep)
    return True
