"""Clouds: shapes that are hard, in containers and types that arrays come in, with any settings."""

from __future__ import annotations

import dataclasses
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from face_plugin import Execution, FaceError, Params, estimate_normals, reconstruct
from face_plugin.params import settings_of

SIZES = (4, 5, 6, 8, 13, 30, 80, 200, 400)


def sphere(r: np.random.Generator, n: int) -> np.ndarray:
    points = r.normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def little(r: np.random.Generator, least: int = 17) -> float:
    return 10.0 ** -r.integers(0, least)


SHAPES: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "cube": lambda r, n: r.random((n, 3)),
    "sphere": sphere,
    "shells": lambda r, n: sphere(r, n) * np.where(np.arange(n) % 2, 1.0, 1 - little(r))[:, None],
    "lattice": lambda r, n: r.integers(0, 5, (n, 3)).astype(float),
    "layers": lambda r, n: np.c_[r.integers(0, 9, (n, 2)), little(r, 12) * r.integers(0, 2, n)].astype(float),
    "sheet": lambda r, n: np.c_[r.random((n, 2)), little(r) * r.random(n)] @ np.linalg.qr(r.normal(size=(3, 3)))[0],
    "line": lambda r, n: np.outer(r.random(n), r.normal(size=3)) + little(r) * r.normal(size=(n, 3)),
    "twins": lambda r, n: r.random((n, 3))[r.integers(0, max(4, n // 3), n)] + little(r) * r.normal(size=(n, 3)),
    "clusters": lambda r, n: np.concatenate([r.random(3) + little(r) * r.normal(size=(n, 3)) for _ in range(3)]),
    "stretched": lambda r, n: sphere(r, n) * [1, little(r, 9), little(r, 9)],
    "far away": lambda r, n: sphere(r, n) + r.normal(size=3) / little(r),
    "stray": lambda r, n: np.r_[sphere(r, n), r.normal(size=(1, 3)) / little(r, 12)],
    "tiny": lambda r, n: sphere(r, n) * 10.0 ** -r.integers(290, 324),
    "huge": lambda r, n: sphere(r, n) * 10.0 ** r.integers(290, 309),
    "few": lambda r, n: r.random((r.integers(0, 6), 3)),
    "wires": lambda r, n: np.eye(3)[r.integers(0, 3, n)] * r.uniform(-1, 1, (n, 1)),
}


class Wrapped:
    """An array of another library."""

    def __init__(self, values: np.ndarray) -> None:
        self.values = values

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self.values if dtype is None else self.values.astype(dtype)


def with_value(points: np.ndarray, value: float) -> np.ndarray:
    points = points.copy()
    points[len(points) // 2 :, 1] = value
    return points


GOOD: dict[str, Callable[[np.ndarray], Any]] = {
    "float64": lambda p: p,
    "float32": lambda p: p.astype(np.float32),
    "float16": lambda p: p.astype(np.float16),
    "long double": lambda p: p.astype(np.longdouble),
    "big endian": lambda p: p.astype(">f8"),
    "int32": lambda p: np.round(np.clip(p * 100, -1e9, 1e9)).astype(np.int32),
    "uint8": lambda p: np.round(np.clip(p * 100, 0, 255)).astype(np.uint8),
    "list": lambda p: p.tolist(),
    "Fortran": np.asfortranarray,
    "strided": lambda p: np.repeat(p, 2, axis=0)[::2],
    "read-only": lambda p: np.frombuffer(p.tobytes()).reshape(p.shape),
    "wrapped": Wrapped,
}
REFUSED: dict[str, Callable[[np.ndarray], Any]] = {
    "complex": lambda p: p.astype(complex),
    "text": lambda p: p.astype(str),
    "objects": lambda p: np.array([[None] * 3] * 5),
    "more columns": lambda p: np.c_[p, p],
    "flat": np.ravel,
    "deep": lambda p: p[None],
    "nothing": lambda p: None,
    "NaN": lambda p: with_value(p, np.nan),
    "infinity": lambda p: with_value(p, np.inf),
    "masked": lambda p: np.ma.masked_array(p, np.arange(p.size).reshape(p.shape) % 2),
    "dates": lambda p: np.zeros((9, 3), dtype="M8[s]"),
}
SETTINGS: dict[str, list[Any]] = {
    "ball_radius": [0.01, 0.3, 0.499999],
    "solid": ["icosahedron"],
    "cage_spacing": [0, 1e-3, np.float32(0.2), 1e300, 1e-300],
    "padding": [1e-300, 0.5, 99],
    "least_side": [0, 1, 1e-9],
    "grading": [2, 0.5],
    "finest": [10, 0.5],
    "directions": ["icosahedron"],
    "solver": ["superlu"],
    "angles": ["field"],
    "alpha": ["dense", "sparse", 0.5, 1e-300],
    "inside": ["winding"],
    "seed": [np.int64(1), 2**64, 10**30],
    "max_memory": [0.4, 1e12],
    "workers": [1, 3],
}
WRONG: list[Any] = [-1, np.nan, np.inf, "no such", [], np.array([0.1, 0.2]), b"auto", 1j, {}, True]
FIELDS = "|".join(field.name for kind in (Params, Execution) for field in dataclasses.fields(kind))


def settings(r: np.random.Generator) -> tuple[dict[str, Any], bool]:
    """Return some settings, and whether they are to be refused."""
    names = r.choice(list(SETTINGS), size=r.choice([0, 0, 0, 1, 2, 3]), replace=False)
    chosen = {str(name): SETTINGS[name][r.integers(len(SETTINGS[name]))] for name in names}
    if r.random() > 0.1:
        return chosen, False
    chosen[str(r.choice(FIELDS.split("|")))] = WRONG[r.integers(len(WRONG))]
    return chosen, True


def prepare() -> None:
    reconstruct(sphere(np.random.default_rng(0), 80), depth=4)


def case(seed: int, folder: Path) -> str:
    r = np.random.default_rng([seed, 1])
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        points = SHAPES[str(r.choice(list(SHAPES)))](r, int(r.choice(SIZES)))
        # Seen from above, points in space are points in the plane.
        plane = r.random() < 0.15
        points = points[:, :2] if plane else points
        refused = r.random() < 0.1
        containers = REFUSED if refused else GOOD
        given = containers[str(r.choice(list(containers)))](points)
    chosen, wrong = settings(r)
    try:
        given_settings = settings_of(chosen)
        assert not wrong, f"accepted {chosen}"
    except ValueError as error:
        assert wrong, str(error)
        assert re.match(rf"({FIELDS}) must ", str(error)), str(error)
        return "settings refused"
    surface = not plane and r.random() < 0.15
    before = given.copy() if isinstance(given, np.ndarray) else None
    try:
        if surface:
            made = reconstruct(given, **given_settings, depth=int(r.integers(2, 6)))
            assert np.isfinite(made.vertices).all()
            assert made.faces.min() >= 0
            assert made.faces.max() < len(made.vertices)
            result = made.result
        else:
            result = estimate_normals(given, **given_settings, filter_interior=bool(r.random() < 0.5))
    except ValueError as error:
        assert re.match(r"(points|cage_spacing|max_memory) must ", str(error)), str(error)
        return "points refused" if refused else "degenerate points refused"
    except FaceError as error:
        assert "try " in str(error), str(error)
        return "says what to try"
    assert not refused or len(points) == 0, "bad points were accepted"
    assert result.normals.shape == points.shape
    np.testing.assert_allclose(np.linalg.norm(result.normals.astype(float), axis=1), 1, atol=1e-5)
    assert np.isfinite(result.strength).all()
    assert ((result.confidence >= 0) & (result.confidence <= 1)).all()
    if before is not None:
        np.testing.assert_array_equal(given, before)
    return "a surface" if surface else "unit normals in the plane" if plane else "unit normals"
