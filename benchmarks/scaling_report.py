"""Tables, fits and curves of what `scaling.py` measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["compare", "fits", "groups", "plot", "row", "stage_seconds"]

# The stages of one piece; tiles add them up over all tiles, in processor time.
STAGES = (
    "cloud", "coarse", "cage", "domain", "mesh", "poisson", "field", "normals", "scene", "refine", "confidence",
    "merge",
)  # fmt: skip
# Fits begin here: below, loading weighs too much, and tiles are smaller than they are meant to be.
FITTED_FROM = {False: 15_000, True: 90_000}

Record = dict[str, Any]


def row(record: Record) -> str:
    """Return a line of the table."""
    how = "one piece" if record["tile_points"] is None else f"tiles, {record['workers']} proc."
    timings = {name: stage_seconds(record, name) for name in STAGES}
    stages = "  ".join(f"{name} {seconds:.1f}" for name, seconds in timings.items() if seconds >= 0.05)
    same = ""
    if "same" in record:
        same = (
            f"  same as one piece: {100 * record['same']:.3f} % outside, {100 * record['same_all']:.3f} % of all, "
            f"{100 * record['same_visible']:.3f} % where there is a field, there {100 * record['same_border']:.3f} % "
            f"of {record['border_points']} at borders, {100 * record['same_elsewhere']:.3f} % elsewhere"
        )
    return (
        f"{record['points']:>9,} {record['shape']}  {how:<15}  {record['seconds']:8.1f} s  "
        f"(cpu {record['cpu_seconds']:.1f})  {record['peak_gb']:.2f} GB  aligned {100 * record['aligned']:.3f} %"
        f"{same}  [{stages}]"
    )


def stage_seconds(record: Record, stage: str) -> float:
    """Return the seconds of a stage: processor time of all tiles together where there are any, else as they passed."""
    timings = record["timings"]
    return float(timings.get(f"tiles: {stage}", timings.get(stage, 0.0)))


def fits(records: list[Record]) -> list[str]:
    """Fit ``time = constant * points ** exponent``, in tiles from 100,000 points on."""
    lines = []
    for (shape, tiled, workers), group in groups(records).items():
        large = [r for r in group if r["points"] > FITTED_FROM[tiled]]
        if len(large) > 1:
            size = np.log([r["points"] for r in large])
            label = f"tiles, {workers} processes" if tiled else "one piece"
            for name in ("seconds", "cpu_seconds", "peak_gb"):
                exponent = np.polyfit(size, np.log([r[name] for r in large]), 1)[0]
                lines.append(f"{shape}, {label}, {large[0]['points']} up: {name} ~ points ** {exponent:.2f}")
    return lines


def compare(records: list[Record]) -> list[str]:
    """Compare runs of the same cloud: in one piece, and in tiles by one or more processes."""
    lines = []
    kinds = groups(records)
    for (shape, tiled, workers), group in kinds.items():
        if not tiled or workers == 1:
            continue
        for record in group:
            for label, kind in (("one piece", (shape, False, None)), ("1 process", (shape, True, 1))):
                for other in kinds.get(kind, []):
                    if other["points"] == record["points"]:
                        lines.append(
                            f"{shape}, {record['points']:,}: {workers} processes are "
                            f"{other['seconds'] / record['seconds']:.2f} times as fast as {label} (processor time "
                            f"{record['cpu_seconds']:.1f} and {other['cpu_seconds']:.1f} s)"
                        )
    return lines


def groups(records: list[Record]) -> dict[tuple[str, bool, int | None], list[Record]]:
    """Return the records of a kind, in the order of their sizes."""
    found: dict[tuple[str, bool, int | None], list[Record]] = {}
    for record in sorted(records, key=lambda r: r["points"]):
        kind = (record["shape"], record["tile_points"] is not None, record["workers"])
        found.setdefault(kind, []).append(record)
    return found


def plot(records: list[Record], path: Path) -> None:
    """Draw time and memory against the number of points."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for (shape, tiled, workers), group in groups(records).items():
        label = f"{shape}, tiles, {workers} process{'es' if workers != 1 else ''}" if tiled else f"{shape}, one piece"
        size = [r["points"] for r in group]
        left.loglog(size, [r["cpu_seconds"] for r in group], "o-", label=label)
        right.loglog(size, [r["peak_gb"] for r in group], "o-", label=label)
    left.set(xlabel="points", ylabel="seconds", title="Processor time")
    right.set(xlabel="points", ylabel="GB, all processes", title="Peak memory")
    for axes in (left, right):
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=7)
    figure.savefig(path, dpi=130)
