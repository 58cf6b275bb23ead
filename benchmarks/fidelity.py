"""Is the fast mesher still FaCE? Its normals against those of the paper's own discretisation, and of fTetWild.

    python benchmarks/fidelity.py
    python benchmarks/fidelity.py --inputs FOLDER --only 'clean*' --output out

Every cloud is solved five times: with the package's defaults, with a plain Delaunay mesh around icosahedra at every
point, with the paper's mesh (`Params.paper()`: TetGen), with the same and the icosahedra turned otherwise, which tells
how far the paper's mesh agrees with itself, and with fTetWild's. Normals are the plain gradients of the field, and in
the last column the refined ones, which are the package's default. Prints a table and whether the default agrees with
the paper's mesh on the clean clouds: median angle below 8 degrees, and the same side at 99.8 % of the points, of both
kinds of normals. Exit status 1 where it does not. Angles and seconds of processor time by stage are drawn into
fidelity.png.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from truth import Array, Case, Clock, arguments, cases, degrees, score, table

from face_plugin import FaCE, MeshingError, Params

MESHERS = {
    "default": Params(angles="field"),
    "icosahedra": Params(mesher="delaunay", solid="icosahedron", cage_spacing=0.0, angles="field"),
    "paper": Params.paper(),
    "paper, turned": Params.paper(seed=1),
    "fTetWild": Params(mesher="tetwild", cage_spacing=0.0, angles="field"),
}
STAGES = ("mesh", "poisson", "field", "normals")
HEADER = [
    "cloud", "mesher", "vertices", "tets", *(f"{stage} s" for stage in STAGES), "aligned %", "error °",
    "to paper: median °", "same side %", "refined %",
]  # fmt: skip
MEDIAN = 8.0
SAME_SIDE = 99.8
PAPER = (
    "The paper reports, for its own C++ with TetGen, 98.47 % of the normals of its ribbon sketches aligned, and "
    "134 s for 20,000 points, most of it meshing."
)


@dataclass(frozen=True)
class Solved:
    """What one mesher made of one cloud."""

    normals: Array
    refined: Array
    vertices: int
    tets: int
    seconds: dict[str, float]


def solve(case: Case, params: Params) -> Solved | str:
    """Solution, or why there is none."""
    clock = Clock()
    try:
        face = FaCE(case.points, params, progress=clock)
    except MeshingError as error:
        return str(error)
    normals = np.asarray(face.normals(), dtype=np.float64)
    seconds = dict(clock.seconds)
    refined = np.asarray(face.with_angles("refined").normals(), dtype=np.float64)
    return Solved(normals, refined, len(face.mesh.vertices), len(face.mesh.tets), seconds)


def same_side(angle: Array) -> float:
    return 100 * float(np.mean(angle < 90))


def row(case: Case, name: str, solved: Solved, angle: Array | None, refined: Array | None) -> list[str]:
    """Line of the table; `angle` is that to the paper's normals, `refined` that between refined ones."""
    aligned, error = score(solved.normals, case)
    cells = [
        case.name, name, str(solved.vertices), str(solved.tets), *(f"{solved.seconds[stage]:.2f}" for stage in STAGES),
        f"{aligned:.2f}", f"{error:.2f}",
    ]  # fmt: skip
    if angle is None or refined is None:
        return [*cells, "", "", ""]
    return [*cells, f"{np.median(angle):.2f}", f"{same_side(angle):.2f}", f"{same_side(refined):.2f}"]


def draw(angles: dict[str, list[Array]], seconds: dict[str, list[dict[str, float]]], path: Path) -> None:
    """Angles to the paper's mesh over all points, and mean seconds by stage."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4), layout="constrained")
    for name, parts in angles.items():
        angle = np.sort(np.concatenate(parts))
        left.plot(angle, np.linspace(0, 100, len(angle)), label=name)
    left.set(
        xlabel="angle to the normal of the paper's mesh, degrees", ylabel="% of points", xlim=(0, 45), ylim=(0, 100)
    )
    left.grid(alpha=0.3)
    left.legend()
    bottom = np.zeros(len(seconds))
    for stage in STAGES:
        height = [float(np.mean([one[stage] for one in by])) for by in seconds.values()]
        right.bar(list(seconds), height, bottom=bottom, label=stage)
        bottom += height
    right.set(ylabel="seconds of processor time, mean over the clouds")
    right.legend()
    figure.savefig(path, dpi=150)


def main() -> int:
    options = arguments(__doc__, points=2000).parse_args()
    clouds = cases(options)
    FaCE(clouds[0].points[:300]).normals()  # compiles
    rows: list[list[str]] = []
    angles: dict[str, list[Array]] = {}
    seconds: dict[str, list[dict[str, float]]] = {}
    disagree: list[str] = []
    for case in clouds:
        solved = {name: solve(case, params) for name, params in MESHERS.items()}
        paper = solved["paper"]
        for name, result in solved.items():
            if isinstance(result, str):
                print(f"{case.name}, {name}: {result}", file=sys.stderr)
                continue
            seconds.setdefault(name, []).append(result.seconds)
            angle = refined = None
            if name != "paper" and isinstance(paper, Solved):
                angle = degrees(result.normals, paper.normals)[case.valid]
                refined = degrees(result.refined, paper.refined)[case.valid]
                angles.setdefault(name, []).append(angle)
                if name == "default" and case.clean:
                    if np.median(angle) >= MEDIAN or same_side(angle) < SAME_SIDE:
                        disagree.append(case.name)
                    if same_side(refined) < SAME_SIDE:
                        disagree.append(f"{case.name} (refined)")
            rows.append(row(case, name, result, angle, refined))
            print(*rows[-1], file=sys.stderr, flush=True)
    options.output.mkdir(parents=True, exist_ok=True)
    draw(angles, seconds, options.output / "fidelity.png")
    (options.output / "fidelity.json").write_text(json.dumps([HEADER, *rows], indent=0))
    print(table(HEADER, rows), "", PAPER, "", sep="\n")
    print(
        f"Median angle of default and paper's mesh below {MEDIAN:g} degrees, same side of {SAME_SIDE:g} %: "
        + (f"not on {', '.join(disagree)}" if disagree else "on every clean cloud")
    )
    return 1 if disagree else 0


if __name__ == "__main__":
    sys.exit(main())
