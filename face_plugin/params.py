"""The settings of the method. Who computes it, and with how much, is told by `face_plugin.execution`."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Mapping
from dataclasses import InitVar, dataclass, fields
from typing import Any, Literal, get_args

from face_plugin.checks import check_integer, check_number
from face_plugin.execution import Execution

__all__ = ["ALPHAS", "Params", "settings_of", "settled"]

Alpha = Literal["auto", "dense", "sparse"]

ALPHAS: dict[str, float] = {"dense": 0.01, "sparse": 0.05}
"""The paper's thresholds by name (section 3.5): "dense" for complete input, "sparse" for input with large gaps."""

CHOICES: dict[str, tuple[str, ...]] = {
    "solid": ("octahedron", "icosahedron"),
    "mesher": ("auto", "delaunay", "tetgen", "tetwild"),
    "directions": ("exact", "icosahedron"),
    "solver": ("auto", "cholmod", "superlu"),
    "angles": ("refined", "field"),
    "nested": ("solid", "cavity"),
    "inside": ("rays", "winding"),
}

MOVED = tuple(field.name for field in fields(Execution))
"""What was a setting of the method once."""


@dataclass(frozen=True)
class Params:
    """Settings of the method; None means derived from the data. NumPy's numbers are kept as Python's.

    Raises
    ------
    ValueError
        A field is outside its range; the message names it.

    Examples
    --------
    >>> Params(solid="icosahedron").padding
    0.1
    """

    # Cage
    ball_radius: float = 0.45
    """Radius of a ball, as a fraction of the distance to the nearest other one; (0, 0.5)."""
    solid: Literal["octahedron", "icosahedron"] = "octahedron"
    """Solid that approximates a ball: 6 or 12 vertices."""
    cage_spacing: float | None = None
    """Smallest distance between two balls, in the unit of the input; 0 = a ball at every point; None = coarse on
    sheets with nothing else near (not with angles="field"), fine where walls are thin, no near-duplicates: see
    `face_plugin.sides.sheets.cage_separation`."""

    # Domain and mesh
    padding: float = 0.1
    """Space around the object, as a fraction of its shortest side; > 0."""
    least_side: float = 0.25
    """A side counts as no shorter than this fraction of the longest one when it sets the padding; [0, 1];
    0 = the paper's padding, which vanishes around a flat object."""
    mesher: Literal["auto", "delaunay", "tetgen", "tetwild"] = "auto"
    """Mesher: plain Delaunay, the paper's TetGen, fTetWild; "auto" is "delaunay", and others where it fails."""
    grading: float = 1.2
    """Size of the tetrahedra far from the points, as a fraction of the distance to the nearest; (0, 2]."""
    finest: float = 1.5
    """Size of the smallest cells of free vertices, in local spacings; (0, 10]."""

    # Field
    directions: Literal["exact", "icosahedron"] = "exact"
    """External fields: the maximum over all directions, or the paper's six."""
    solver: Literal["auto", "cholmod", "superlu"] = "auto"
    """Sparse factorisation; "auto" is CHOLMOD where scikit-sparse is installed."""

    # Normals
    angles: Literal["refined", "field"] = "refined"
    """Normals refined from the points themselves, or the plain gradient of the field strength (the paper's)."""

    nested: Literal["solid", "cavity"] = "solid"
    """What a closed body within another is: one more solid, inside the object, or a cavity of it, whose wall faces
    inward and is kept; a body in the cavity is solid again."""

    # Interior
    alpha: float | Literal["auto", "dense", "sparse"] = "auto"
    """Field strength (unshielded space has 1) below which space counts as inside; (0, 1). "dense" and "sparse" are the
    paper's 0.01 and 0.05; "auto" derives it from the data and spares dents that are open to the outside."""
    inside: Literal["rays", "winding"] = "rays"
    """Test of a point against the isosurface: embree rays, or the winding number. Tiles need neither: a point is inside
    where the field at it is below alpha."""

    # Moved to `Execution`; as arguments they are still taken, with a warning.
    tile_points: InitVar = None  # type: ignore[type-arg]  # Python 3.10 cannot look up the hint of a typed one
    max_memory: InitVar = None  # type: ignore[type-arg]
    engine: InitVar = None  # type: ignore[type-arg]
    workers: InitVar = None  # type: ignore[type-arg]

    # Everything
    seed: int = 0
    """Seed of the random turns, jitters and orders; >= 0."""

    def __post_init__(self, tile_points: object, max_memory: object, engine: object, workers: object) -> None:
        check_number(self, "ball_radius", 0.0, 0.5)
        check_number(self, "padding", 0.0, 100.0)
        check_number(self, "least_side", 0.0, 1.0, closed=True, least=True)
        check_number(self, "grading", 0.0, 2.0, closed=True)
        check_number(self, "finest", 0.0, 10.0, closed=True)
        if self.cage_spacing is not None:
            check_number(self, "cage_spacing", 0.0, math.inf, least=True)
        if isinstance(self.alpha, str):
            if self.alpha not in get_args(Alpha):
                raise ValueError(f"alpha must be a number or one of {get_args(Alpha)}, found {self.alpha!r}")
        else:
            check_number(self, "alpha", 0.0, 1.0)
        for name, allowed in CHOICES.items():
            # Of an array, `in` would ask for the truth.
            if not isinstance(getattr(self, name), str) or getattr(self, name) not in allowed:
                raise ValueError(f"{name} must be one of {allowed}, found {getattr(self, name)!r}")
        check_integer(self, "seed", 0)
        given = zip(MOVED, (tile_points, max_memory, engine, workers), strict=True)
        moved: dict[str, Any] = {name: value for name, value in given if value is not None}
        if moved:
            execution = Execution(**moved)
            moved = {name: getattr(execution, name) for name in moved}
            _warn_of_moved(moved, stacklevel=4)
            for name, value in moved.items():
                # Read by `settled`, and by `dataclasses.replace`.
                object.__setattr__(self, name, value)

    @classmethod
    def paper(cls, **changes: Any) -> Params:
        """Return the paper's own choices.

        Icosahedra at every point, a box padded by 0.1 times its shortest side, TetGen with its quality bounds,
        six directions, plain gradients, its threshold for complete input and winding numbers.

        Examples
        --------
        >>> Params.paper().directions
        'icosahedron'
        """
        paper = cls(
            ball_radius=0.45,
            solid="icosahedron",
            cage_spacing=0.0,
            padding=0.1,
            least_side=0.0,
            mesher="tetgen",
            directions="icosahedron",
            angles="field",
            alpha="dense",
            inside="winding",
        )
        return dataclasses.replace(paper, **changes)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields by name, for JSON."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def settled(
    params: Params | None, execution: Execution | None = None, engine: object = None
) -> tuple[Params, Execution]:
    """Return the settings of the method and those of its execution, the default ones for None.

    Parameters
    ----------
    params : Params, optional
        What it still says of the execution goes there.
    execution : Execution, optional
    engine : str, Engine or distributed.Client, optional
        From where it was an argument: `execution` has it now.

    Raises
    ------
    TypeError
        One of them is something else, such as a dict.
    ValueError
        The same is said in two places.

    Examples
    --------
    >>> settled(None) == (Params(), Execution())
    True
    """
    for name, kind, value in (("params", Params, params), ("execution", Execution, execution)):
        if value is not None and not isinstance(value, kind):
            hint = f": pass face_plugin.{kind.__name__}(**settings)" if isinstance(value, dict) else ""
            raise TypeError(f"{name} must be a face_plugin.{kind.__name__} or None, found {type(value).__name__}{hint}")
    params = params or Params()
    moved = {name: getattr(params, name) for name in MOVED if getattr(params, name) is not None}
    if moved:
        params = Params(**params.to_dict())
    if engine is not None:
        _warn_of_moved({"engine": engine}, stacklevel=4)
        # Where it is given in both of the old places, the argument counts.
        moved["engine"] = engine
    if execution is None:
        return params, Execution(**moved)
    if moved:
        raise ValueError(f"{', '.join(moved)} must be given in execution alone, found execution and the old place")
    return params, execution


def settings_of(values: Mapping[str, Any]) -> dict[str, Any]:
    """Sort settings by their names into the arguments `params` and `execution`; what nothing is said of is not there.

    Examples
    --------
    >>> settings_of({"workers": 2})
    {'execution': Execution(tile_points=None, max_memory=None, engine='auto', workers=2)}
    """
    execution = {name: value for name, value in values.items() if name in MOVED}
    params = {name: value for name, value in values.items() if name not in MOVED}
    settings: dict[str, Any] = {"params": Params(**params)} if params else {}
    return settings | ({"execution": Execution(**execution)} if execution else {})


def _warn_of_moved(moved: dict[str, Any], stacklevel: int) -> None:
    arguments = ", ".join(f"{name}={value!r}" for name, value in moved.items())
    warnings.warn(
        f"{', '.join(moved)}: no longer a setting of the method; pass execution=face_plugin.Execution({arguments})",
        DeprecationWarning,
        stacklevel=stacklevel,
    )
