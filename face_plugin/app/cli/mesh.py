"""`face mesh`: a cloud in, a closed surface out."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import (
    add_command,
    add_interior,
    add_method,
    add_sculpt,
    add_surface,
    execution_of,
    params_of,
    surface_of,
)
from face_plugin.app.cli.sensors import add_sensors, sensors_in
from face_plugin.io import CLOUD_SUFFIXES, MESH_SUFFIXES, check_output, read_cloud, write_cloud, write_mesh
from face_plugin.surface import is_closed

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
    add_interior(parser, default=True)
    add_sculpt(parser)
    add_surface(parser)
    add_sensors(parser)
    add_method(parser)


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Reconstruct and write a surface."""
    from face_plugin.estimate import reconstruct

    output = check_output(args.output, MESH_SUFFIXES)
    side_output = None if args.cloud is None else check_output(args.cloud, CLOUD_SUFFIXES)
    params, execution, options = params_of(args), execution_of(args), surface_of(args)
    with console.stage("read"):
        cloud = read_cloud(args.input)
    surface = reconstruct(
        cloud.points,
        params,
        filter_interior=args.filter_interior,
        **sensors_in(args, console, cloud),
        sculpt=args.sculpt,
        execution=execution,
        progress=console.progress,
        **options,
    )
    result = surface.result
    strays = int(result.strays.sum())
    interior = 0 if result.interior is None else int(result.interior.sum())
    kept = int(result.kept.sum())
    with console.stage("write"):
        write_mesh(output, surface.vertices, surface.faces)
        if side_output is not None:
            write_cloud(side_output, cloud, normals=result.normals, keep=result.kept)
    closed = is_closed(surface.faces)
    summary = {
        "input": args.input,
        "output": output,
        "points": len(cloud),
        "strays": strays,
        "interior": interior,
        "kept": kept,
        "dropped": len(cloud) - kept,
        "vertices": len(surface.vertices),
        "faces": len(surface.faces),
        "closed": closed,
        "timings": result.timings,
        "params": result.params.to_dict(),
        "execution": execution.to_dict(),
    }
    text = f"{output}: {len(surface.faces):,} triangles, {'closed' if closed else 'open'}, from "
    text += f"{kept:,} of {len(cloud):,} points"
    left_out = [f"{count:,} {what}" for count, what in ((interior, "inside the object"), (strays, "strays")) if count]
    return summary, text + (f" ({', '.join(left_out)} left out)" if left_out else "")
