"""The paper's own studies in small: a table and a figure each.

    python benchmarks/studies.py
    python benchmarks/studies.py noise spiral --points 4000 --output out

directions  the paper's six external fields, and other numbers of them, against the maximum over all directions
balls       octahedron, icosahedron and once-subdivided icosahedron as the shape of a ball
noise       Gaussian noise of 0.25, 0.5 and 1 % of the diagonal; 5, 10 and 20 % of white-noise points
spiral      an Archimedean spiral of varying thickness (figure 13)
shielded    a flask, whose inside is shielded, at two densities (figure 14)

Normals are the plain gradients of the field. Tables go to the standard output, figures to `--output`.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from scipy.spatial.transform import Rotation
from study_shapes import flask, spiral
from truth import GENERATED, Array, Case, degrees, generated, score, table

from face_plugin import FaCE, Params, shapes
from face_plugin.faraday import domain, field, gradient
from face_plugin.faraday.balls import SOLIDS
from face_plugin.faraday.meshers.select import build_mesh
from face_plugin.faraday.poisson import Poisson
from face_plugin.geometry import local_spacing

matplotlib.use("Agg")
from matplotlib import pyplot

EVERY_POINT = Params(cage_spacing=0.0, angles="field")
PAPER_MESH = Params.paper()
NOISES = (0.0, 0.0025, 0.005, 0.01)
STRAYS = (0.0, 0.05, 0.1, 0.2)
BODIES = ("torus", "bowl 0.2", "teapot")


def bodies(points: int) -> list[Case]:
    return [generated(name, GENERATED[name](points, 0)) for name in BODIES]


def spread(count: int) -> Array:
    """Return `count` directions, evenly over half the sphere: opposite fields are equally strong."""
    k = np.arange(count) + 0.5
    z, angle = 1 - k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def at_points(face: FaCE, strength: Array) -> Array:
    """Return normals (n, 3) of the input from E_max at the vertices, with a ball at every point."""
    return face.frame.unrotate(gradient.field_normals(face.mesh, strength))[face.cloud.rows]


def directions(points: int, output: Path) -> None:
    counts = (3, 6, 12, 24, 48, 96)
    turns = Rotation.random(8, random_state=0)
    rows, curves = [], {}
    for case in bodies(points):
        face = FaCE(case.points, EVERY_POINT)
        gradients = field.vertex_gradients(face.mesh, face.potential())
        exact = at_points(face, field.strength_exact(gradients))
        curve = []
        for count in counts:
            chosen = field.half_icosahedron() if count == 6 else np.eye(3) if count == 3 else spread(count)
            found = [at_points(face, field.strength_of_directions(gradients, turn.apply(chosen))) for turn in turns]
            angle = np.concatenate([degrees(one, exact) for one in found])
            scores = np.mean([score(one, case) for one in found], axis=0)
            curve.append(float(angle.mean()))
            rows.append([case.name, str(count), f"{angle.mean():.2f}", f"{np.percentile(angle, 99):.2f}",
                         f"{scores[0]:.2f}", f"{scores[1]:.2f}"])  # fmt: skip
        aligned, error = score(exact, case)
        rows.append([case.name, "all", "0.00", "0.00", f"{aligned:.2f}", f"{error:.2f}"])
        curves[case.name] = curve
    header = ["cloud", "directions", "mean angle to all °", "99 % below °", "aligned %", "error °"]
    print("## Number of directions, turned at random eight times\n", table(header, rows), "", sep="\n")
    figure, axes = pyplot.subplots(figsize=(6, 4), layout="constrained")
    for name, curve in curves.items():
        axes.loglog(counts, curve, "o-", label=name)
    axes.set(xlabel="directions", ylabel="mean angle to the normals of all directions, degrees", xticks=counts)
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.legend()
    figure.savefig(output / "study_directions.png", dpi=150)


def subdivided(solid: Array) -> Array:
    """Return unit vectors (42, 3): vertices of an icosahedron and the middles of its edges, pushed to the sphere."""
    distance = np.linalg.norm(solid[:, None] - solid[None], axis=2)
    i, j = np.nonzero(np.triu(np.isclose(distance, distance[distance > 0.1].min())))
    middle = solid[i] + solid[j]
    return np.concatenate([solid, middle / np.linalg.norm(middle, axis=1, keepdims=True)])


def balls(points: int, output: Path) -> None:
    """Call the stages one by one: the third shape is no parameter of the package."""
    icosahedron = SOLIDS["icosahedron"]
    kinds = {"octahedron": SOLIDS["octahedron"], "icosahedron": icosahedron, "subdivided": subdivided(icosahedron)}
    rows, errors = [], {}
    for case in bodies(points):
        face = FaCE(case.points, EVERY_POINT)
        found = {}
        for kind, solid in kinds.items():
            made = face.balls
            turns = Rotation.random(len(made.radii), random_state=0).as_matrix()
            vertices = made.centres[:, None] + made.radii[:, None, None] * (solid @ turns.transpose(0, 2, 1))
            made = dataclasses.replace(made, vertices=vertices)
            box = domain.padded_box(made, EVERY_POINT.padding)
            mesh = build_mesh(made, local_spacing(made.centres), box, EVERY_POINT)
            potential = Poisson(mesh).solve(mesh.vertices[mesh.boundary])
            strength = field.strength(mesh, potential, "exact")
            found[kind] = face.frame.unrotate(gradient.field_normals(mesh, strength))[face.cloud.rows]
            errors.setdefault(kind, []).append(score(found[kind], case)[1])
            angle = degrees(found[kind], found["icosahedron"]) if "icosahedron" in found else np.full(1, np.nan)
            rows.append([case.name, kind, str(len(mesh.vertices)), *(f"{x:.2f}" for x in score(found[kind], case)),
                         "" if np.isnan(angle[0]) or kind == "icosahedron" else f"{np.median(angle):.2f}"])  # fmt: skip
    header = ["cloud", "ball", "vertices", "aligned %", "error °", "median angle to icosahedra °"]
    print("## Shape of a ball\n", table(header, rows), "", sep="\n")
    figure, axes = pyplot.subplots(figsize=(6, 4), layout="constrained")
    for k, (kind, error) in enumerate(errors.items()):
        axes.bar(np.arange(len(error)) + 0.25 * (k - 1), error, 0.25, label=kind)
    axes.set_xticks(np.arange(len(BODIES)), BODIES)
    axes.set(ylabel="mean error of the normals, degrees")
    axes.legend()
    figure.savefig(output / "study_balls.png", dpi=150)


def noise(points: int, output: Path) -> None:
    settings = {"default": Params(angles="field"), "ball at every point": EVERY_POINT}
    rows: list[list[str]] = []
    figure, panels = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained", sharey=True)
    for axes, kind, levels in ((panels[0], "noise", NOISES), (panels[1], "strays", STRAYS)):
        curves: dict[tuple[str, str], list[float]] = {}
        for name in BODIES:
            shape = GENERATED[name](points, 0)
            diagonal = float(np.linalg.norm(np.ptp(shape.points, axis=0)))
            for level in levels:
                spoilt = (
                    shapes.with_noise(shape, level * diagonal)
                    if kind == "noise"
                    else shapes.with_outliers(shape, level)
                )
                case = generated(name, spoilt)
                for setting, params in settings.items():
                    aligned, error = score(np.asarray(FaCE(case.points, params).normals(), dtype=np.float64), case)
                    curves.setdefault((name, setting), []).append(aligned)
                    rows.append([name, f"{100 * level:g} % {kind}", setting, f"{aligned:.2f}", f"{error:.2f}"])
        for (name, setting), curve in curves.items():
            axes.plot(
                100 * np.array(levels), curve, "o-" if setting == "default" else "s--", label=f"{name}, {setting}"
            )
        axes.set(xlabel="standard deviation, % of the diagonal" if kind == "noise" else "white-noise points, %")
    panels[0].set(ylabel="aligned normals, %")
    panels[0].legend(fontsize=7)
    figure.savefig(output / "study_noise.png", dpi=150)
    print("## Noise\n", table(["cloud", "spoilt by", "cage", "aligned %", "error °"], rows), "", sep="\n")


def section(axes: Any, case: Case, found: Array, axis: int, width: float, title: str) -> None:
    """Draw the points of a slice and their normals, green where they are on the true side, red elsewhere."""
    near = np.abs(case.points[:, axis]) < width
    u, v = (k for k in range(3) if k != axis)
    colour = np.where((found * case.normals).sum(axis=1) > 0, "tab:green", "tab:red")[near]
    p, n = case.points[near], found[near]
    axes.quiver(p[:, u], p[:, v], n[:, u], n[:, v], color=colour, scale=25, width=0.003)
    axes.scatter(p[:, u], p[:, v], s=3, color=colour)
    axes.set(aspect="equal", title=title)
    axes.set_axis_off()


def spiral_study(points: int, output: Path) -> None:
    case, wall = spiral(points)
    spacing = float(np.median(local_spacing(case.points)))
    settings = {"Delaunay, octahedra": EVERY_POINT, "the paper's mesh": PAPER_MESH}
    edges = np.linspace(wall.min(), wall.max(), 6)
    band = np.clip(np.digitize(wall, edges) - 1, 0, 4)
    rows = []
    figure, panels = pyplot.subplots(1, len(settings), figsize=(10, 5), layout="constrained")
    for axes, (name, params) in zip(panels, settings.items(), strict=True):
        found = np.asarray(FaCE(case.points, params).normals(), dtype=np.float64)
        good = 100 * ((found * case.normals).sum(axis=1) > 0)
        for k in range(5):
            rows.append(
                [name, f"{edges[k] / spacing:.1f} to {edges[k + 1] / spacing:.1f}", f"{good[band == k].mean():.2f}"]
            )
        rows.append([name, "all", f"{good.mean():.2f}"])
        section(axes, case, found, 2, 1.5 * spacing, f"{name}: {good.mean():.2f} % aligned")
    figure.savefig(output / "study_spiral.png", dpi=150)
    print("## Spiral of varying thickness\n", table(["mesh", "thickness in spacings", "aligned %"], rows), "", sep="\n")


def shielded(points: int, output: Path) -> None:
    settings = {"Delaunay, octahedra": EVERY_POINT, "the paper's mesh": PAPER_MESH}
    rows = []
    figure, panels = pyplot.subplots(len(settings), 2, figsize=(9, 9), layout="constrained")
    for column, count in enumerate((points // 4, points)):
        case = flask(count)
        inside = np.linalg.norm(case.points, axis=1) < 0.925
        spacing = float(np.median(local_spacing(case.points)))
        for line, (name, params) in enumerate(settings.items()):
            found = np.asarray(FaCE(case.points, params).normals(), dtype=np.float64)
            good = 100 * ((found * case.normals).sum(axis=1) > 0)
            rows.append(
                [str(count), name, f"{good.mean():.2f}", f"{good[~inside].mean():.2f}", f"{good[inside].mean():.2f}"]
            )
            title = f"{count} points, {name}: {good.mean():.1f} % aligned"
            section(panels[line, column], case, found, 1, spacing, title)
    figure.savefig(output / "study_shielded.png", dpi=150)
    header = ["points", "mesh", "aligned %", "on the outside %", "on the inside %"]
    print("## Shielded concave shape\n", table(header, rows), "", sep="\n")


STUDIES = {"directions": directions, "balls": balls, "noise": noise, "spiral": spiral_study, "shielded": shielded}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", metavar="STUDY", help="by default all")
    parser.add_argument("--points", type=int, default=3000, help="points of a cloud")
    parser.add_argument("--output", type=Path, default=Path("out"), help="folder for the figures")
    options = parser.parse_args()
    unknown = set(options.studies) - set(STUDIES)
    if unknown:
        parser.error(f"no such study: {', '.join(sorted(unknown))}; there are {', '.join(STUDIES)}")
    options.output.mkdir(parents=True, exist_ok=True)
    for name in options.studies or STUDIES:
        STUDIES[name](options.points, options.output)


if __name__ == "__main__":
    main()
