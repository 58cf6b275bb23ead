"""Clouds whose normals are known: generated, or read from a folder; and how well normals meet the truth."""

from __future__ import annotations

import argparse
import fnmatch
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from face_plugin import shapes

Array = NDArray[np.float64]

GENERATED: dict[str, Callable[[int, int], shapes.Shape]] = {
    "sphere": shapes.sphere,
    "torus": shapes.torus,
    "box": shapes.box,
    "ellipsoid": shapes.ellipsoid,
    "slab 0.1": lambda n, seed: shapes.slab(n, seed, thickness=0.1),
    "bowl 0.2": lambda n, seed: shapes.bowl(n, seed, thickness=0.2),
    "crossed cylinders": shapes.crossed_cylinders,
    "two spheres": shapes.two_spheres,
    "disjoint spheres": shapes.disjoint_spheres,
    "nested box": shapes.nested_box,
    "teapot": shapes.teapot,
    "box in teapot": shapes.demo_shape,
    "deep cup": lambda n, seed: shapes.cup(n, seed, depth=1.5, thickness=0.2),
}
HARD = ("deep cup",)


@dataclass(frozen=True)
class Case:
    """A cloud with its truth."""

    name: str
    points: Array
    """(n, 3)."""
    normals: Array
    """(n, 3) true outward unit normals."""
    valid: NDArray[np.bool_]
    """(n,) the points whose truth is known: those on the outer surface."""
    clean: bool
    """Whether it is an even sample of a closed surface without deep hollows."""


class Clock:
    """Seconds of processor time by stage, those of child processes included; to be given as `progress`.

    Other work on the machine lengthens the seconds of the wall, not these.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._start: dict[str, float] = {}

    def __call__(self, stage: str, fraction: float) -> None:
        """Note the start and the end of a stage."""
        now = sum(os.times()[:4])
        if fraction == 0.0:
            self._start[stage] = now
        elif fraction == 1.0:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._start[stage]


def arguments(description: str | None, points: int) -> argparse.ArgumentParser:
    """Parser with the options that choose the clouds."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=points, help="points of a generated cloud")
    parser.add_argument(
        "--inputs",
        type=Path,
        help="folder of .npz files with points, normals and, where not all count, valid, instead of generated clouds",
    )
    parser.add_argument("--only", default="*", help="names of the clouds, with wildcards; several: a,b")
    parser.add_argument("--output", type=Path, default=Path("out"), help="folder for what is written")
    return parser


def cases(options: argparse.Namespace) -> list[Case]:
    """Clouds that the options name."""
    patterns = options.only.split(",")
    if options.inputs is None:
        names: Iterable[str] = GENERATED
    else:
        names = sorted(path.stem for path in options.inputs.glob("*.npz"))
    chosen = [name for name in names if any(fnmatch.fnmatch(name, pattern) for pattern in patterns)]
    if not chosen:
        raise SystemExit(f"no cloud matches {options.only!r}")
    if options.inputs is None:
        return [generated(name, GENERATED[name](options.points, 0)) for name in chosen]
    return [read(options.inputs / f"{name}.npz") for name in chosen]


def generated(name: str, shape: shapes.Shape) -> Case:
    """Case of a generated shape: what is inside, or has no truth, does not count."""
    valid = ~shape.interior & np.isfinite(shape.normals).all(axis=1)
    return Case(name, shape.points, shape.normals, valid, name not in HARD)


def read(path: Path) -> Case:
    """Case of a file, named ``category__name.npz`` or ``name.npz``."""
    with np.load(path) as data:
        clean = "__" not in path.stem or path.stem.startswith("clean__")
        valid = data["valid"] if "valid" in data else np.ones(len(data["points"]), dtype=np.bool_)
        return Case(path.stem, data["points"], data["normals"].astype(np.float64), valid, clean)


def degrees(a: Array, b: Array) -> Array:
    """Angles (n,) between unit vectors."""
    return np.asarray(np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", a, b), -1, 1))))


def score(normals: Array, case: Case) -> tuple[float, float]:
    """Per cent of normals on the true side, and the mean angle to the truth in degrees."""
    angle = degrees(normals, case.normals)[case.valid]
    return 100 * float(np.mean(angle < 90)), float(angle.mean())


def table(header: list[str], rows: list[list[str]]) -> str:
    """Markdown table, columns aligned for reading as it stands."""
    width = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    lines = [header, ["-" * w for w in width], *rows]
    return "\n".join("| " + " | ".join(c.ljust(w) for c, w in zip(line, width, strict=True)) + " |" for line in lines)
