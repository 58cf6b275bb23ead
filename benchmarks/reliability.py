"""Does confidence find the normals on the wrong side? By category, as a Markdown table and a reliability diagram.

    python benchmarks/reliability.py [--inputs FOLDER] [--output out]

Held: share of the normals on the wrong side that the least confident tenth of the points holds. Then the share of wrong
ones, in percent, among points of so much confidence. Either side of a scan as a whole counts as right, as no hint is
given. The category of a file is its name before ``__``. Leaves ``reliability.png``.
"""

from __future__ import annotations

import itertools
from collections import defaultdict

import matplotlib.pyplot as plt
import numpy as np
import truth
from numpy.typing import NDArray

import face_plugin

BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 1.0)
# A bin of fewer points tells nothing.
FEWEST = 100
Array = NDArray[np.float64]


def judged(case: truth.Case) -> tuple[Array, NDArray[np.bool_]]:
    """Confidence of the points whose truth is known, and which of them are on the wrong side."""
    result = face_plugin.estimate_normals(case.points)
    wrong = np.einsum("nd,nd->n", result.normals, case.normals)[case.valid] < 0
    return result.confidence[case.valid], ~wrong if wrong.mean() > 0.5 else wrong


def main() -> None:
    options = truth.arguments(__doc__, 6000).parse_args()
    found: dict[str, list[tuple[Array, NDArray[np.bool_]]]] = defaultdict(list)
    for case in truth.cases(options):
        found[case.name.split("__")[0] if "__" in case.name else "generated"].append(judged(case))
    every = {name: tuple(map(np.concatenate, zip(*parts, strict=True))) for name, parts in found.items()}
    rows, figure, axes = [], *plt.subplots(figsize=(5, 4), layout="constrained")
    for name, (confidence, wrong) in every.items():
        least = np.argsort(confidence, kind="stable")[: len(wrong) // 10]
        which = np.digitize(confidence, BINS[1:-1])
        count = np.bincount(which, minlength=len(BINS) - 1)
        share = 100 * np.bincount(which, wrong, minlength=len(BINS) - 1) / np.maximum(count, 1)
        held = f"{100 * wrong[least].sum() / max(wrong.sum(), 1):.0f}"
        told = [f"{s:.2f}" if n >= FEWEST else "-" for s, n in zip(share, count, strict=True)]
        rows.append([name, f"{len(wrong):,}", f"{100 * wrong.mean():.2f}", held, *told])
        centre = [confidence[which == k].mean() if count[k] >= FEWEST else np.nan for k in range(len(count))]
        axes.plot(centre, share, "o-", label=name)
    names = [f"{a:g} to {b:g}" for a, b in itertools.pairwise(BINS)]
    print(truth.table(["category", "points", "wrong, %", "held, %", *names], rows))
    axes.set(xlabel="confidence", ylabel="on the wrong side, %", xlim=(0, 1))
    axes.set_yscale("symlog", linthresh=0.1)
    axes.legend()
    options.output.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.output / "reliability.png", dpi=120)


if __name__ == "__main__":
    main()
