"""What `face mesh` and `face ribbons` share: the options of a reconstruction, and what is said of it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from face_plugin.app.cli.options import (
    add_interior,
    add_method,
    add_sculpt,
    add_surface,
    execution_of,
    params_of,
    surface_of,
)
from face_plugin.app.cli.sensors import add_sensors
from face_plugin.result import Side, Surface
from face_plugin.surface import is_closed

__all__ = ["add_reconstruction", "reconstruction_of", "summary_of"]


def add_reconstruction(parser: argparse.ArgumentParser) -> None:
    """Add all options of a surface made from points."""
    add_interior(parser, default=True)
    add_sculpt(parser)
    add_surface(parser)
    add_sensors(parser)
    add_method(parser)


def reconstruction_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return these options but the sensors as keywords of `face_plugin.reconstruct`; what cannot be is said now."""
    return {
        "params": params_of(args),
        "execution": execution_of(args),
        "filter_interior": args.filter_interior,
        "sculpt": args.sculpt,
        **surface_of(args),
    }


def summary_of(surface: Surface, args: argparse.Namespace, output: Path) -> tuple[dict[str, Any], str]:
    """Return what was made, for JSON, and the beginning of it in words."""
    result, closed = surface.result, is_closed(surface.faces)
    kept = int(result.kept.sum())
    summary = {
        "input": args.input,
        "output": output,
        "points": len(result.normals),
        "strays": int(result.strays.sum()),
        "interior": 0 if result.interior is None else int(result.interior.sum()),
        "kept": kept,
        "dropped": len(result.normals) - kept,
        "vertices": len(surface.vertices),
        "faces": len(surface.faces),
        "closed": closed,
        "open": int(result.open.sum()),
        "sides": Side.count(result.sides),
        "timings": result.timings,
        "params": result.params.to_dict(),
        "execution": execution_of(args).to_dict(),
    }
    return summary, f"{output}: {len(surface.faces):,} triangles, {'closed' if closed else 'open'}, from "
