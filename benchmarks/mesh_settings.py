"""Accuracy against time of the settings of the Delaunay mesher; from this table its defaults were chosen.

    python benchmarks/mesh_settings.py
    python benchmarks/mesh_settings.py --inputs FOLDER --only 'clean*,ribbon*' --output out

Each row changes what it names of the base setting. Figures are means over the clouds; seconds are processor time.
Normals are the plain gradients of the field: refinement (`--angles refined`) hides the mesh.
"""

from __future__ import annotations

import dataclasses
import fnmatch
import json
import os
import sys
from typing import Any

import numpy as np
from truth import Case, Clock, arguments, cases, score, table

from face_plugin import FaCE, Params

BASE = Params(
    mesher="delaunay", solid="octahedron", grading=0.8, finest=1.5, ball_radius=0.45, padding=0.1, angles="field"
)
ICO = {"solid": "icosahedron"}
SETTINGS: list[dict[str, Any]] = [
    {},
    {"grading": 0.4},
    {"grading": 1.0},
    {"grading": 1.2},
    {"grading": 2.0},
    {"finest": 0.75},
    {"finest": 1.0},
    {"finest": 2.0},
    {"finest": 3.0},
    {"finest": 5.0},
    {"padding": 0.05},
    {"padding": 0.2},
    {"padding": 0.5},
    {"ball_radius": 0.1},
    {"ball_radius": 0.15},
    {"ball_radius": 0.2},
    {"ball_radius": 0.25},
    {"ball_radius": 0.35},
    {"ball_radius": 0.49},
    {"ball_radius": 0.35, "grading": 1.2},
    {"ball_radius": 0.25, "grading": 1.2},
    {"ball_radius": 0.25, "grading": 1.2, "finest": 1.0},
    {"ball_radius": 0.25, "grading": 1.2, "finest": 2.0},
    {"ball_radius": 0.15, "grading": 1.2, "finest": 1.0},
    ICO,
    {**ICO, "finest": 1.0},
    {**ICO, "finest": 2.0},
    {**ICO, "finest": 3.0},
    {**ICO, "ball_radius": 0.15},
    {**ICO, "ball_radius": 0.25},
    {**ICO, "ball_radius": 0.25, "grading": 1.2, "finest": 1.0},
    {**ICO, "ball_radius": 0.35, "finest": 3.0},
    {**ICO, "padding": 0.2, "finest": 3.0},
]
HEADER = ["setting", "aligned %", "worst %", "error °", "vertices a ball", "mesh s", "Poisson s", "field s", "all s"]


def name(change: dict[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in change.items()) or "base"


def measure(case: Case, params: Params) -> dict[str, float]:
    clock = Clock()
    face = FaCE(case.points, params, progress=clock)
    aligned, error = score(np.asarray(face.normals(), dtype=np.float64), case)
    seconds = {stage: clock.seconds[stage] for stage in ("mesh", "poisson", "field")}
    vertices = len(face.mesh.vertices) / len(face.balls.radii)
    return {"aligned": aligned, "error": error, "vertices": vertices, **seconds, "all": sum(clock.seconds.values())}


def row(change: dict[str, Any], results: list[dict[str, float]]) -> list[str]:
    mean = {key: float(np.mean([result[key] for result in results])) for key in results[0]}
    worst = min(result["aligned"] for result in results)
    seconds = [f"{mean[key]:.2f}" for key in ("mesh", "poisson", "field", "all")]
    accuracy = [f"{mean['aligned']:.2f}", f"{worst:.2f}", f"{mean['error']:.2f}"]
    return [name(change), *accuracy, f"{mean['vertices']:.1f}", *seconds]


def main() -> None:
    parser = arguments(__doc__, points=3000)
    parser.add_argument("--settings", default="*", help="names of the rows, with wildcards; several: a;b")
    parser.add_argument("--angles", choices=["field", "refined"], default=BASE.angles)
    options = parser.parse_args()
    base = dataclasses.replace(BASE, angles=options.angles)
    patterns = options.settings.split(";")
    clouds = cases(options)
    FaCE(clouds[0].points[:500], base).normals()  # compiles
    rows, raw = [], {}
    for change in SETTINGS:
        if not any(fnmatch.fnmatch(name(change), pattern) for pattern in patterns):
            continue
        results = [measure(case, dataclasses.replace(base, **change)) for case in clouds]
        raw[name(change)] = dict(zip((case.name for case in clouds), results, strict=True))
        rows.append(row(change, results))
        print(*rows[-1], sep="  ", file=sys.stderr, flush=True)
    print(f"{len(clouds)} clouds, {sum(len(case.points) for case in clouds)} points; base: {name_of_base()}\n")
    print(table(HEADER, rows))
    os.makedirs(options.output, exist_ok=True)
    (options.output / "mesh_settings.json").write_text(json.dumps(raw, indent=1))


def name_of_base() -> str:
    return name({key: getattr(BASE, key) for key in ("solid", "grading", "finest", "ball_radius", "padding")})


if __name__ == "__main__":
    main()
