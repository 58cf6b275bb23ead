"""`face view`: a cloud in a window, to be sculpted by clicks."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import add_command, add_method, add_sculpt, execution_of, params_of
from face_plugin.app.cli.sensors import add_sensors, sensors_in
from face_plugin.io import CLOUD_SUFFIXES, MESH_SUFFIXES, check_output, read_cloud

__all__ = ["register"]


def register(commands: Any) -> None:
    """Add the subcommand."""
    parser = add_command(
        commands, "view", run, "open a window on the points, the field and its proxy, to carve and to shield"
    )
    add_sculpt(parser)
    parser.add_argument(
        "--save-sculpt",
        metavar="JSON",
        type=Path,
        help="where the window saves the edits [default: IN_sculpt.json]",
    )
    parser.add_argument(
        "--save-mesh",
        metavar="OUT",
        type=Path,
        help=f"where it saves the surface ({', '.join(MESH_SUFFIXES)}) [default: IN_mesh.ply]",
    )
    parser.add_argument(
        "--save-viewpoints",
        metavar="OUT",
        type=Path,
        help="where it saves the sensors placed by clicks, for --viewpoints [default: IN_viewpoints.csv]",
    )
    parser.add_argument("--screenshot", metavar="PNG", type=Path, help="write a picture instead of opening a window")
    parser.add_argument("--up", choices=("x", "y", "z"), default="z", help="the axis that points upward [default: z]")
    parser.add_argument(
        "--cut", choices=("x", "y", "z"), help="cut the object open across this axis, and show the field there"
    )
    add_sensors(parser, up="--seen-up")
    add_method(parser)


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Solve, and open the window or write the picture."""
    from face_plugin.app.viewer.session import Session
    from face_plugin.app.viewer.window import Viewer
    from face_plugin.errors import require
    from face_plugin.sides.sensors import sensors_of

    sculpt_file = args.save_sculpt or args.input.with_name(f"{args.input.stem}_sculpt.json")
    mesh_file = args.save_mesh or args.input.with_name(f"{args.input.stem}_mesh.ply")
    viewpoints_file = args.save_viewpoints or args.input.with_name(f"{args.input.stem}_viewpoints.csv")
    if args.save_viewpoints is not None:
        check_output(viewpoints_file, CLOUD_SUFFIXES)
    if args.save_sculpt is not None:
        check_output(sculpt_file, (".json",))
    if args.save_mesh is not None:
        check_output(mesh_file, MESH_SUFFIXES)
    if args.screenshot is not None:
        check_output(args.screenshot, (".png", ".jpg"))
    # Said now rather than after the computation.
    require("polyscope", extra="viewer")
    params, execution = params_of(args), execution_of(args)
    with console.stage("read"):
        cloud = read_cloud(args.input)
    sensors = sensors_of(**sensors_in(args, console, cloud))
    session = Session(
        cloud.points, params, execution=execution, sculpt=args.sculpt, sensors=sensors, progress=console.progress
    )
    viewer = Viewer(
        session,
        sculpt_file=sculpt_file,
        mesh_file=mesh_file,
        viewpoints_file=viewpoints_file,
        headless=args.screenshot is not None,
        up=args.up,
        cut=args.cut,
    )
    if args.screenshot is None:
        viewer.show()
    else:
        viewer.screenshot(args.screenshot)
    edits = session.face.edits
    summary = {
        "input": args.input,
        "screenshot": args.screenshot,
        "points": len(cloud),
        "alpha": session.alpha,
        "interior": int(session.interior().sum()),
        "charges": sum(edit.kind == "charge" for edit in edits),
        "sensors": len(session.viewpoints),
        "cage_points": sum(edit.kind == "cage" for edit in edits),
        "params": params.to_dict(),
        "execution": execution.to_dict(),
    }
    text = f"{args.input}: {len(cloud):,} points, {len(edits)} edits"
    return summary, text if args.screenshot is None else f"{args.screenshot}: picture of {text}"
