"""`face mesh`: a cloud in, a closed surface out."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import add_command
from face_plugin.app.cli.sensors import sensors_in
from face_plugin.app.cli.surfaces import add_reconstruction, reconstruction_of, summary_of
from face_plugin.io import CLOUD_SUFFIXES, MESH_SUFFIXES, check_output, read_cloud, write_cloud, write_mesh

__all__ = ["register"]


def register(commands: Any) -> None:
    """Add the subcommand."""
    parser = add_command(
        commands,
        "mesh",
        run,
        "reconstruct a closed surface: normals, interior points left out, Poisson reconstruction",
        output=f"mesh ({', '.join(MESH_SUFFIXES)})",
    )
    parser.add_argument(
        "--cloud",
        metavar="PATH",
        type=Path,
        help="also write the points it was made from, with their normals",
    )
    add_reconstruction(parser)


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Reconstruct and write a surface."""
    from face_plugin.estimate import reconstruct

    output = check_output(args.output, MESH_SUFFIXES)
    side_output = None if args.cloud is None else check_output(args.cloud, CLOUD_SUFFIXES)
    options = reconstruction_of(args)
    with console.stage("read"):
        cloud = read_cloud(args.input)
    surface = reconstruct(cloud.points, **options, **sensors_in(args, console, cloud), progress=console.progress)
    with console.stage("write"):
        write_mesh(output, surface.vertices, surface.faces)
        if side_output is not None:
            write_cloud(side_output, cloud, normals=surface.result.normals, keep=surface.result.kept)
    summary, text = summary_of(surface, args, output)
    text += f"{summary['kept']:,} of {len(cloud):,} points"
    counts = ((summary["interior"], "inside the object"), (summary["strays"], "strays"))
    left_out = [f"{count:,} {what}" for count, what in counts if count]
    return summary, text + (f" ({', '.join(left_out)} left out)" if left_out else "")
