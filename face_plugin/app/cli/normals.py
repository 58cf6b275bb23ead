"""`face normals`: a cloud in, the same cloud with outward normals out."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import add_command, add_interior, add_method, add_sculpt, execution_of, params_of
from face_plugin.app.cli.sensors import add_sensors, sensors_in
from face_plugin.execution import Execution
from face_plugin.io import CLOUD_SUFFIXES, check_output, read_cloud, write_cloud
from face_plugin.params import Params
from face_plugin.result import Side

__all__ = ["register"]


def register(commands: Any) -> None:
    """Add the subcommand."""
    parser = add_command(
        commands,
        "normals",
        run,
        "estimate outward normals; everything else in the file is kept",
        output=f"cloud with normals ({', '.join(CLOUD_SUFFIXES)})",
    )
    add_interior(parser, default=False)
    parser.add_argument("--mark-interior", action="store_true", help="write whether each point is inside (0 or 1)")
    parser.add_argument(
        "--scalars", action="store_true", help="write field strength, confidence and what told the side"
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep tiles on disk, and go on from those of an interrupted run (npy, ply, las, laz)",
    )
    add_sculpt(parser)
    add_sensors(parser)
    add_method(parser)


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Estimate and write normals."""
    from face_plugin.estimate import estimate_normals
    from face_plugin.tiles.files import streams

    output = check_output(args.output, CLOUD_SUFFIXES)
    params, execution = params_of(args), execution_of(args)
    if args.resume or streams(args.input, output, execution):
        return _in_parts(args, params, execution, console)
    with console.stage("read"):
        cloud = read_cloud(args.input)
    wanted = args.filter_interior or args.mark_interior
    result = estimate_normals(
        cloud.points,
        params,
        filter_interior=wanted,
        **sensors_in(args, console, cloud),
        sculpt=args.sculpt,
        execution=execution,
        progress=console.progress,
    )
    extra: dict[str, NDArray[Any]] = {}
    if args.scalars:
        extra.update({"strength": result.strength, "confidence": result.confidence, "sides": result.sides})
    inside = result.interior if result.interior is not None else np.zeros(len(cloud), dtype=np.bool_)
    if args.mark_interior:
        extra["interior"] = inside
    keep = result.kept if args.filter_interior else None
    with console.stage("write"):
        write_cloud(output, cloud, normals=result.normals, extra=extra, keep=keep)
    sides = Side.count(result.sides)
    written = len(cloud) if keep is None else int(keep.sum())
    summary = {
        "input": args.input,
        "output": output,
        "points": len(cloud),
        "written": written,
        "strays": int(result.strays.sum()),
        "interior": int(inside.sum()) if wanted else None,
        "mean_confidence": float(result.confidence.mean()),
        "sides": sides,
        "timings": result.timings,
        "params": result.params.to_dict(),
        "execution": execution.to_dict(),
    }
    dropped = f", {len(cloud) - written:,} interior points and strays left out" if keep is not None else ""
    return summary, f"{output}: {written:,} points with normals{dropped}{_guessed(sides)}"


def _in_parts(
    args: argparse.Namespace, params: Params, execution: Execution, console: Console
) -> tuple[dict[str, Any], str]:
    """Estimate and write the normals of a file that is never held as a whole."""
    if args.sculpt is not None:
        raise ValueError("--sculpt needs the cloud in one piece: more --max-memory, and no --resume")
    from face_plugin.sides.sensors import sensors_of
    from face_plugin.tiles.files import normals_of_file

    done = normals_of_file(
        args.input,
        args.output,
        params,
        sensors=sensors_of(**sensors_in(args, console)),
        filter_interior=args.filter_interior,
        mark_interior=args.mark_interior,
        scalars=args.scalars,
        execution=execution,
        resume=args.resume,
        progress=console.progress,
    )
    summary = {
        "input": args.input,
        "output": args.output,
        "points": done.points,
        "written": done.written,
        "strays": done.strays,
        "interior": done.interior,
        "mean_confidence": done.mean_confidence,
        "sides": done.sides,
        "timings": done.timings,
        "params": params.to_dict(),
        "execution": execution.to_dict(),
    }
    dropped = f", {done.points - done.written:,} interior points and strays left out" if args.filter_interior else ""
    return summary, f"{args.output}: {done.written:,} points with normals{dropped}{_guessed(done.sides)}"


def _guessed(sides: dict[str, int]) -> str:
    count = sides["chosen"]
    return f"; the side of {count:,} is a guess: say --viewpoint or --up" if count else ""
