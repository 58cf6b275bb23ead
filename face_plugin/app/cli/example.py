"""`face example`: sample data, generated."""

from __future__ import annotations

import argparse
from typing import Any

from face_plugin import examples
from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import add_command
from face_plugin.io import CLOUD_SUFFIXES, CloudFile, check_output, write_cloud

__all__ = ["register"]


def register(commands: Any) -> None:
    """Add the subcommand."""
    parser = add_command(
        commands,
        "example",
        run,
        "write generated sample points, without normals, to try things on",
        output=f"point cloud ({', '.join(CLOUD_SUFFIXES)})",
        inputs=None,
    )
    parser.add_argument("name", metavar="NAME", choices=examples.NAMES, help=", ".join(examples.NAMES))
    parser.add_argument(
        "--points", type=int, default=examples.POINTS, metavar="N", help=f"how many [default: {examples.POINTS}]"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the random numbers [default: 0]")


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Generate and write an example."""
    output = check_output(args.output, CLOUD_SUFFIXES)
    scan = examples.load(args.name, args.points, args.seed)
    write_cloud(output, CloudFile(scan.points, viewpoints=scan.viewpoints))
    summary = {
        "output": output,
        "points": len(scan),
        "viewpoints": None if scan.viewpoints is None else scan.viewpoints.tolist(),
        "up": None if scan.up is None else scan.up.tolist(),
    }
    text = f"{output}: {len(scan):,} points"
    if scan.viewpoints is not None:
        text += f", seen from {summary['viewpoints']}"
    if scan.up is not None:
        text += f", seen from above: up is {summary['up']}"
    return summary, text
