"""`face chain`: the steps of a file, one after the other."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from face_plugin.app.cli.console import Console
from face_plugin.app.cli.options import add_command
from face_plugin.app.cli.sensors import own_viewpoints
from face_plugin.io import (
    CLOUD_SUFFIXES,
    MESH_SUFFIXES,
    READ_SUFFIXES,
    check_output,
    read_cloud,
    write_cloud,
    write_mesh,
)

__all__ = ["register"]


def register(commands: Any) -> None:
    """Add the subcommand."""
    parser = add_command(
        commands,
        "chain",
        run,
        "run a chain of filter steps: normals, interior, thin, sculpt, surface",
        output=f"the points kept ({', '.join(CLOUD_SUFFIXES)}), or of a chain that ends with a surface "
        f"a mesh ({', '.join(MESH_SUFFIXES)})",
        inputs="chain of steps",
        suffixes=(".toml", ".json"),
    )
    parser.add_argument("cloud", metavar="CLOUD", type=Path, help=f"point cloud ({', '.join(READ_SUFFIXES)})")


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Run the chain and write what it leaves."""
    from face_plugin.filters import Chain, Normals, PointSet, Reconstruct
    from face_plugin.sides.sensors import sensors_of

    chain = Chain.load(args.input)
    meshed = any(isinstance(step, Reconstruct) for step in chain.steps)
    output = check_output(args.output, MESH_SUFFIXES if meshed else CLOUD_SUFFIXES)
    with console.stage("read"):
        cloud = read_cloud(args.cloud)
    said = any(isinstance(step, Normals) and step.sensors is not None for step in chain.steps)
    sensors = None if said else sensors_of(own_viewpoints(cloud, console))
    layer = chain(PointSet(cloud.points, cloud.normals, sensors=sensors), progress=console.progress)
    kept = int(layer.keep.sum())
    with console.stage("write"):
        if layer.surface is not None:
            write_mesh(output, layer.surface.vertices, layer.surface.faces)
        else:
            write_cloud(output, cloud, normals=layer.normals, extra=layer.attributes, keep=layer.keep)
    summary: dict[str, Any] = {
        "input": args.cloud,
        "output": output,
        "points": len(cloud),
        "kept": kept,
        **chain.to_dict(),
    }
    text = f"{output}: {kept:,} of {len(cloud):,} points"
    if layer.surface is not None:
        summary |= {"vertices": len(layer.surface.vertices), "faces": len(layer.surface.faces)}
        text = f"{output}: {len(layer.surface.faces):,} triangles from {kept:,} of {len(cloud):,} points"
    return summary, text
