"""`face plot`: pictures of a cloud, its normals and its field, or of what the interior filter does."""

from __future__ import annotations

import argparse
from typing import Any

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import (
    add_command,
    add_method,
    add_sculpt,
    add_surface,
    execution_of,
    params_of,
    surface_of,
)
from face_plugin.app.cli.sensors import add_sensors, sensors_in
from face_plugin.io import check_output, read_cloud
from face_plugin.params import ALPHAS, Params

__all__ = ["register"]


def register(commands: Any) -> None:
    """Add the subcommand."""
    parser = add_command(
        commands,
        "plot",
        run,
        "draw the points by field strength, the normals by direction and a slice of the field",
        output="picture (.png, .jpg, .pdf, .svg)",
    )
    parser.add_argument(
        "--interior",
        action="store_true",
        help="draw instead the points kept and dropped, and the surfaces from all points and from those kept",
    )
    parser.add_argument(
        "--view",
        type=_view,
        default=(35.0, 20.0),
        metavar="AZ,EL",
        help="where the camera stands, degrees [default: 35,20]",
    )
    parser.add_argument("--up", choices=("x", "y", "z"), default="z", help="the axis that points upward [default: z]")
    parser.add_argument(
        "--axis", choices=("x", "y", "z"), help="the axis that the slice cuts across [default: the shortest]"
    )
    parser.add_argument("--title", help="title of the picture [default: the name of the file]")
    add_sculpt(parser)
    add_surface(parser)
    add_sensors(parser, up="--seen-up")
    add_method(parser)


def _view(text: str) -> tuple[float, float]:
    azimuth, elevation = (float(word) for word in text.split(","))
    return azimuth, elevation


_view.__name__ = "azimuth,elevation"


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Solve, draw and save."""
    from face_plugin.app import plot
    from face_plugin.errors import require
    from face_plugin.estimate import estimate_normals, solve_whole
    from face_plugin.sides.sensors import sensors_of
    from face_plugin.surface import poisson_reconstruction

    output = check_output(args.output, plot.PLOT_SUFFIXES)
    # Said now rather than after the computation.
    require("matplotlib", extra="plot")
    params, execution, options = params_of(args), execution_of(args), surface_of(args)
    with console.stage("read"):
        cloud = read_cloud(args.input)
    points, seen = cloud.points, sensors_in(args, console, cloud)
    plane = points.shape[1] == 2
    if args.interior and args.sculpt is None and not plane:
        result = estimate_normals(
            points, params, filter_interior=True, **seen, execution=execution, progress=console.progress
        )
    else:
        # A slice shows the field between the points.
        face = solve_whole(
            points,
            params,
            purpose="a slice of the field",
            sensors=sensors_of(**seen),
            execution=execution,
            progress=console.progress,
        )
        if args.sculpt is not None:
            face = face.sculpted(args.sculpt)
        result = face.result(filter_interior=args.interior)
    looks = {
        "title": args.input.name if args.title is None else args.title,
        "view": args.view,
        "up": args.up,
        "axis": args.axis,
    }
    summary = {"input": args.input, "output": output, "points": len(points)}
    if plane:
        with console.stage("draw"):
            figure = plot.plot_curves(
                points,
                result.normals,
                plot.field_within(face),
                interior=result.interior,
                alpha=_threshold(result.params),
                title=looks["title"],
            )
        if result.interior is not None:
            summary["dropped"] = int(result.interior.sum())
    elif args.interior and result.interior is not None:
        meshes = []
        for keep in (~result.strays, result.kept):
            with console.stage("surface"):
                given = points[keep], result.normals[keep]
                meshes.append(poisson_reconstruction(*given, open_at=result.open[keep], **options)[:2])
        with console.stage("draw"):
            reached = plot.space_reached(points[~result.strays], result.normals[~result.strays])
            figure = plot.plot_interior(
                points, result.interior, *meshes, strays=result.strays, reached=reached, **looks
            )
        summary["dropped"] = int(result.interior.sum())
        summary["strays"] = int(result.strays.sum())
    else:
        with console.stage("draw"):
            field = plot.field_within(face)
            level = _threshold(result.params)
            figure = plot.plot_result(points, result.normals, result.strength, field, alpha=level, **looks)
    plot.save_figure(figure, output)
    summary.update({"timings": result.timings, "params": result.params.to_dict(), "execution": execution.to_dict()})
    return summary, f"{output}: picture of {len(points):,} points"


def _threshold(params: Params) -> float | None:
    """Return the level of the field that counts as inside, where it is a number by now."""
    return ALPHAS.get(params.alpha) if isinstance(params.alpha, str) else params.alpha
