"""`face ribbons`: a ribbon sketch in, a closed surface out."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import add_command
from face_plugin.app.cli.sensors import sensors_in
from face_plugin.app.cli.surfaces import add_reconstruction, reconstruction_of, summary_of
from face_plugin.io import MESH_SUFFIXES, check_output, write_mesh

__all__ = ["register"]

_SUFFIXES = (".ply", ".obj")


def register(commands: Any) -> None:
    """Add the subcommand."""
    parser = add_command(
        commands,
        "ribbons",
        run,
        "reconstruct a closed surface from a ribbon sketch drawn in virtual reality",
        output=f"mesh ({', '.join(MESH_SUFFIXES)})",
        inputs="ribbon sketch",
        suffixes=_SUFFIXES,
    )
    density = parser.add_mutually_exclusive_group()
    density.add_argument("--points", type=int, metavar="N", help="points sampled on the ribbons [default: 10000]")
    density.add_argument("--spacing", type=float, metavar="S", help="smallest distance between two points instead")
    parser.add_argument(
        "--width", type=float, metavar="W", help="width of ribbons given by their centre lines only (OBJ)"
    )
    parser.add_argument(
        "--normals",
        metavar="PATH",
        type=Path,
        help=f"also write the sketch with outward normals at its own vertices ({', '.join(_SUFFIXES)})",
    )
    add_reconstruction(parser)


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Read and sample a sketch, reconstruct and write its surface."""
    from face_plugin.estimate import reconstruct
    from face_plugin.ribbons import normals_at_vertices, read_sketch, sample, write_normals

    output = check_output(args.output, MESH_SUFFIXES)
    side_output = None if args.normals is None else check_output(args.normals, _SUFFIXES)
    options = reconstruction_of(args)
    with console.stage("read"):
        sketch = read_sketch(args.input, width=args.width)
    with console.stage("sample"):
        samples = sample(sketch, args.points, spacing=args.spacing, seed=options["params"].seed)
    surface = reconstruct(samples.points, **options, **sensors_in(args, console), progress=console.progress)
    with console.stage("write"):
        write_mesh(output, surface.vertices, surface.faces)
        if side_output is not None:
            write_normals(side_output, sketch, normals_at_vertices(sketch, samples, surface.result.normals))
    summary, text = summary_of(surface, args, output)
    summary |= {"strokes": sketch.stroke_count, "problems": list(sketch.problems)}
    return summary, text + f"{sketch.stroke_count:,} strokes ({summary['kept']:,} of {summary['points']:,} points)"
