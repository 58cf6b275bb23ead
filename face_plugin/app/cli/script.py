"""`face script`: a MeshLab filter script in which our filters may stand between MeshLab's own."""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path
from typing import Any

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import add_command
from face_plugin.errors import FaceError, require
from face_plugin.io import check_output

__all__ = ["register"]


def register(commands: Any) -> None:
    """Add the subcommand."""
    parser = add_command(
        commands,
        "script",
        run,
        "run a MeshLab filter script with FaCE among its filters (needs pymeshlab)",
        output="the layer that is current at the end, in a format that MeshLab writes",
        inputs="point cloud or mesh",
        suffixes=("what MeshLab reads",),
    )
    parser.add_argument("script", metavar="SCRIPT", type=Path, help="filter script (.mlx)")


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Load, run the script, and save."""
    ml = require("pymeshlab", extra="pymeshlab")
    from face_plugin.adapters.pymeshlab import run_filter_script

    output = check_output(args.output, (args.output.suffix.lower(),))
    ms = ml.MeshSet(verbose=False)
    try:
        with console.stage("read"):
            ms.load_new_mesh(str(args.input))
        # Raises now, for a format that MeshLab does not write, what saving would raise at the end.
        ms.filter_parameter_values(output.suffix.lower().lstrip("."))
    except ml.PyMeshLabException as error:
        raise ValueError(f"{args.input} to {output}: {error}") from error
    try:
        with console.stage("script"):
            run_filter_script(ms, args.script)
    except ml.PyMeshLabException as error:
        raise FaceError(f"{args.script}: {error}") from error
    mesh = ms.current_mesh()
    for name in mesh.textures():
        # MeshLab saves a texture where its name leads, seen from the layer's file.
        if Path(name).name != name or "\\" in name:
            raise ValueError(f"{args.script} on {args.input}: the texture {name!r} would leave the folder of {output}")
    # MeshLab may write more than one file (an OBJ has its materials beside it): all of them, or none.
    with console.stage("write"), tempfile.TemporaryDirectory(dir=output.resolve().parent) as folder:
        ms.save_current_mesh(str(Path(folder) / output.name))
        for path in Path(folder).iterdir():
            os.replace(path, output.resolve().parent / path.name)
    summary = {
        "input": args.input,
        "output": output,
        "script": args.script,
        "layers": ms.mesh_number(),
        "vertices": mesh.vertex_number(),
        "faces": mesh.face_number(),
    }
    return summary, f"{output}: {mesh.vertex_number():,} vertices and {mesh.face_number():,} triangles"
