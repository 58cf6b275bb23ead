"""`face info`: what a file of points holds."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import add_command
from face_plugin.io import CloudFile, read_cloud
from face_plugin.threads import KDTree

__all__ = ["register"]

# Distances are measured from at most so many points, evenly taken: a median needs no more.
SAMPLE = 100_000
# Strays are told by all neighbours of all points: about a second a million of them, and two gigabytes.
MOST_JUDGED = 1_000_000


def register(commands: Any) -> None:
    """Add the subcommand."""
    add_command(commands, "info", run, "say what a point cloud file holds")


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Read a file and describe it."""
    cloud = read_cloud(args.input)
    summary = {"input": args.input, **describe(cloud)}
    lines = [str(args.input)]
    for name, value in summary.items():
        if name != "input" and value is not None:
            lines.append(f"  {name.replace('_', ' '):<12} {_text(value)}")
    return summary, "\n".join(lines)


def describe(cloud: CloudFile) -> dict[str, Any]:
    """Return what `face info` says of a cloud, by name."""
    finite = np.isfinite(cloud.points).all(axis=1)
    points = cloud.points[finite].astype(np.float64)
    distinct = np.unique(points, axis=0)
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (None, None)
    spacing = None
    if len(distinct) > 1:
        probe = distinct[:: len(distinct) // SAMPLE + 1]
        spacing = float(np.median(KDTree(distinct).query(probe, k=2)[0][:, 1]))
    return {
        "points": len(cloud),
        "dtype": str(cloud.points.dtype),
        "non_finite": int((~finite).sum()),
        "duplicates": len(points) - len(distinct),
        "lower": None if low is None else low.tolist(),
        "upper": None if high is None else high.tolist(),
        "diagonal": None if low is None or high is None else float(np.linalg.norm(high - low)),
        "spacing": spacing,
        "strays": _strays(points),
        "normals": cloud.normals is not None,
        "viewpoints": None if cloud.viewpoints is None else len(cloud.viewpoints),
        "attributes": {name: str(values.dtype) for name, values in cloud.attributes.items()},
    }


def _strays(points: NDArray[np.float64]) -> int | None:
    """Count the points too far from everything; None where they are too many to count in a moment, or no body."""
    from face_plugin.cloud import prepare
    from face_plugin.neighbourhood import Neighbourhood
    from face_plugin.sides.strays import find_strays

    if len(points) > MOST_JUDGED:
        return None
    try:
        prepared = prepare(points)
    except ValueError:
        return None
    return int(find_strays(Neighbourhood(prepared.points))[prepared.rows].sum())


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return "  ".join(f"{item:.6g}" for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{name} ({kind})" for name, kind in value.items()) or "none"
    return str(value)
