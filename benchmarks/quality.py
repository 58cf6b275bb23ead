"""Quality against recorded figures of other methods: a table by category, and a bar chart.

    python benchmarks/quality.py OURS.tsv [--peers PEERS.tsv] [--output FOLDER]

Both files hold rows ``method <tab> input <tab> align ME SE u_cd u_hd s_cd s_hd seconds`` (tab-separated; a header row
is skipped), where an input is named ``category__name``:

- align: points whose normal has a positive dot product with the truth, in %
- ME, SE: mean and standard deviation of the angle to the truth, in degrees
- u_cd, u_hd, s_cd, s_hd: mean squared two-way distance and two-way Hausdorff distance between the Poisson surface
  (unscreened, screened) of the points kept and the truth, in units of the bounding-box diagonal

Without OURS.tsv, the method is scored here on generated shapes, align and ME only.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

COLUMNS = ("align", "ME", "SE", "u_cd", "u_hd", "s_cd", "s_hd", "seconds")
SHOWN = ("align", "ME", "s_cd", "s_hd", "seconds")

Rows = dict[str, dict[str, list[float]]]


def read(path: Path) -> Rows:
    """Rows by method and input."""
    rows: Rows = defaultdict(dict)
    with path.open() as file:
        for row in csv.reader(file, delimiter="\t"):
            if row[0] != "method":
                rows[row[0]][row[1]] = [float(x) for x in row[2:]]
    return rows


def means(rows: Rows) -> dict[str, dict[str, dict[str, float]]]:
    """Mean of each column by category and method; a method counts where it has every input of the category."""
    inputs = defaultdict(set)
    for method in rows.values():
        for name in method:
            inputs[name.split("__")[0]].add(name)
    table: dict[str, dict[str, dict[str, float]]] = defaultdict(dict)
    for category, names in sorted(inputs.items()):
        for method, figures in rows.items():
            if names <= figures.keys():
                mean = np.mean([figures[name] for name in sorted(names)], axis=0)
                table[category][method] = dict(zip(COLUMNS, mean, strict=True))
    return table


def generated() -> Rows:
    """Score the method on generated shapes."""
    from truth import GENERATED

    import face_plugin

    rows: Rows = {"face-plugin": {}}
    for name, make in GENERATED.items():
        shape = make(3000, 0)
        start = time.perf_counter()
        normals = face_plugin.estimate_normals(shape.points).normals
        seconds = time.perf_counter() - start
        cosine = np.clip((normals * shape.normals).sum(axis=1)[~shape.interior], -1, 1)
        angle = np.degrees(np.arccos(cosine))
        nothing = [float("nan")] * 4
        rows["face-plugin"][f"generated__{name}"] = [
            100 * float((cosine > 0).mean()), float(angle.mean()), float(angle.std()), *nothing, seconds,
        ]  # fmt: skip
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ours", type=Path, nargs="?")
    parser.add_argument("--peers", type=Path)
    parser.add_argument("--output", type=Path, default=Path("out"))
    args = parser.parse_args()
    rows = read(args.ours) if args.ours else generated()
    if args.peers:
        rows = {**read(args.peers), **rows}
    table = means(rows)
    print("| category | method | " + " | ".join(SHOWN) + " |")
    print("|---" * (len(SHOWN) + 2) + "|")
    for category, methods in table.items():
        for method, figures in methods.items():
            print(f"| {category} | {method} | " + " | ".join(f"{figures[c]:.4g}" for c in SHOWN) + " |")
    if args.peers:
        args.output.mkdir(parents=True, exist_ok=True)
        chart(table, args.output / "quality.png")


def chart(table: dict[str, dict[str, dict[str, float]]], path: Path) -> None:
    """Bars of each method by category: misaligned normals and distance of the surface."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    methods = sorted({m for row in table.values() for m in row}, key=lambda m: (m == "face-plugin", m))
    figure = Figure(figsize=(12, 7), layout="constrained")
    FigureCanvasAgg(figure)
    panels = (("align", "misaligned normals, %"), ("s_cd", "screened Poisson: mean squared distance"))
    for axes, (column, label) in zip(figure.subplots(2), panels, strict=True):
        for k, method in enumerate(methods):
            found = [(i, row[method][column]) for i, row in enumerate(table.values()) if method in row]
            place = [i + (k - len(methods) / 2) * 0.8 / len(methods) for i, _ in found]
            height = [max(100 - y, 1e-3) if column == "align" else y for _, y in found]
            axes.bar(place, height, 0.8 / len(methods), label=method, color=f"C{k}")
        axes.set(xticks=range(len(table)), xticklabels=list(table), yscale="log", ylabel=label)
        axes.spines[["top", "right"]].set_visible(False)
    handles, labels = max((axes.get_legend_handles_labels() for axes in figure.axes), key=lambda found: len(found[1]))
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
