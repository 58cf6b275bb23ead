"""All settings in one place."""

from __future__ import annotations

import dataclasses
import math
import numbers
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

__all__ = ["ALPHAS", "Params", "checked"]

Alpha = Literal["auto", "dense", "sparse"]

ALPHAS: dict[str, float] = {"dense": 0.01, "sparse": 0.05}
"""The paper's thresholds by name (section 3.5): "dense" for complete input, "sparse" for input with large gaps."""

CHOICES: dict[str, tuple[str, ...]] = {
    "solid": ("octahedron", "icosahedron"),
    "mesher": ("auto", "delaunay", "tetgen", "tetwild"),
    "directions": ("exact", "icosahedron"),
    "solver": ("auto", "cholmod", "superlu"),
    "angles": ("refined", "field"),
    "inside": ("rays", "winding"),
}

ENGINES = ("auto", "serial", "processes", "dask")
SMALLEST_TILE = 1000
"""A smaller tile would consist of its halo."""


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

    # Interior
    alpha: float | Literal["auto", "dense", "sparse"] = "auto"
    """Field strength (unshielded space has 1) below which space counts as inside; (0, 1). "dense" and "sparse" are the
    paper's 0.01 and 0.05; "auto" derives it from the data and spares dents that are open to the outside."""
    inside: Literal["rays", "winding"] = "rays"
    """Test of a point against the isosurface: embree rays, or the winding number. Tiles need neither: a point is inside
    where the field at it is below alpha."""

    # Large clouds
    tile_points: int | None = None
    """Points of a tile, >= 1000; a cloud of no more is solved in one piece; None = tiles of 40,000 above 100,000."""
    max_memory: float | None = None
    """Memory that all processes together may take, in gigabytes (1e9 bytes); None = half of what is free."""
    engine: str = "auto"
    """Who solves tiles: "serial" = this process, "processes" = several of this machine, "dask" = Dask's workers, or
    the address of a Dask scheduler; "auto" is "processes" where more than one fits."""
    workers: int | None = None
    """Tiles solved at a time, >= 1; None = as many as there are cores."""

    # Everything
    seed: int = 0
    """Seed of the random turns, jitters and orders; >= 0."""

    def __post_init__(self) -> None:
        _number(self, "ball_radius", 0.0, 0.5)
        _number(self, "padding", 0.0, 100.0)
        _number(self, "least_side", 0.0, 1.0, closed=True, least=True)
        _number(self, "grading", 0.0, 2.0, closed=True)
        _number(self, "finest", 0.0, 10.0, closed=True)
        if self.cage_spacing is not None:
            _number(self, "cage_spacing", 0.0, math.inf, least=True)
        if isinstance(self.alpha, str):
            if self.alpha not in get_args(Alpha):
                raise ValueError(f"alpha must be a number or one of {get_args(Alpha)}, found {self.alpha!r}")
        else:
            _number(self, "alpha", 0.0, 1.0)
        for name, allowed in CHOICES.items():
            # Of an array, `in` would ask for the truth.
            if not isinstance(getattr(self, name), str) or getattr(self, name) not in allowed:
                raise ValueError(f"{name} must be one of {allowed}, found {getattr(self, name)!r}")
        _integer(self, "seed", 0)
        if self.tile_points is not None:
            _integer(self, "tile_points", SMALLEST_TILE)
        if self.max_memory is not None:
            _number(self, "max_memory", 0.0, math.inf)
        if self.workers is not None:
            _integer(self, "workers", 1)
        if not isinstance(self.engine, str) or (self.engine not in ENGINES and "://" not in self.engine):
            raise ValueError(f"engine must be one of {ENGINES} or an address, found {self.engine!r}")

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


def checked(params: Params | None) -> Params:
    """Return the settings, the default ones for None.

    Raises
    ------
    TypeError
        It is something else, such as a dict.

    Examples
    --------
    >>> checked(None) == Params()
    True
    """
    if params is None:
        return Params()
    if not isinstance(params, Params):
        hint = ": pass face_plugin.Params(**settings)" if isinstance(params, dict) else ""
        raise TypeError(f"params must be a face_plugin.Params or None, found {type(params).__name__}{hint}")
    return params


def _integer(params: Params, name: str, least: int) -> None:
    """Raise unless the field is an integer of at least `least`."""
    value = getattr(params, name)
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < least:
        raise ValueError(f"{name} must be an integer >= {least}, found {value!r}")
    object.__setattr__(params, name, int(value))


def _number(params: Params, name: str, low: float, high: float, *, closed: bool = False, least: bool = False) -> None:
    """Raise unless the field is a number in (low, high); `closed` admits `high`, `least` admits `low`."""
    value = getattr(params, name)
    span = f"{'[' if least else '('}{low:g}, {high:g}{']' if closed else ')'}"
    try:
        number = math.nan if isinstance(value, bool) or not isinstance(value, numbers.Real) else float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name} must be a finite number in {span}, found {value!r}")
    if not (low < number < high or (least and number == low) or (closed and number == high)):
        raise ValueError(f"{name} must be in {span}, found {value!r}")
    object.__setattr__(params, name, number)
