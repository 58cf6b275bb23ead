"""Options that say where sensors stood: positions, a file of them, or a direction from afar."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from face_plugin.app.cli.console import Console
from face_plugin.io import CloudFile, read_cloud

__all__ = ["add_sensors", "joined", "own_viewpoints", "sensors_in"]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# In place of a file: the cloud's own viewpoints are not used.
_NONE = Path("none")
# Options whose value may start with a minus sign.
_SIGNED = ("--viewpoint", "--up", "--seen-up")


def add_sensors(parser: argparse.ArgumentParser, *, up: str = "--up") -> None:
    """Add ``--viewpoint``, ``--viewpoints`` and ``--up``, the last under another name where that one is taken."""
    group = parser.add_argument_group("where it was seen from")
    group.add_argument(
        "--viewpoint",
        metavar="X,Y,Z",
        type=_position,
        action="append",
        help="where a sensor stood, in the unit of the file: normals point to what it saw; may be given several times",
    )
    group.add_argument(
        "--viewpoints",
        metavar="FILE",
        type=Path,
        help="file of such positions, such as a trajectory (CSV, PLY, ...); none: not even those that IN holds",
    )
    group.add_argument(
        "--seen-from",
        metavar="COLUMN",
        help="column of IN with the number of the viewpoint that saw each point, from 0; -1 where that is not known",
    )
    group.add_argument(
        up,
        dest="seen_up",
        metavar="AXIS|X,Y,Z",
        type=_direction,
        help="direction from which all was seen, from afar: x, y, z, -z or a vector; z for most aerial scans",
    )


def joined(words: Sequence[str]) -> list[str]:
    """Join options whose value starts with a minus sign to it: argparse would take the value for an option.

    Examples
    --------
    >>> joined(["mesh", "--up", "-z", "--viewpoint", "-1,0,2"])
    ['mesh', '--up=-z', '--viewpoint=-1,0,2']
    """
    result: list[str] = []
    for word in words:
        if result and result[-1] in _SIGNED and word[:1] == "-" and word[:2] != "--":
            result[-1] += f"={word}"
        else:
            result.append(word)
    return result


def sensors_in(args: argparse.Namespace, console: Console, cloud: CloudFile | None = None) -> dict[str, Any]:
    """Return sensors as the library takes them by keyword: as given, or else those that the file holds.

    Raises
    ------
    ValueError
        What was given, or the file of viewpoints, is not what it should be.
    """
    from face_plugin.sides.sensors import sensors_of

    given: list[NDArray[Any]] = [np.array(args.viewpoint)] if args.viewpoint else []
    if args.viewpoints not in (None, _NONE):
        given.append(read_cloud(args.viewpoints).points.astype(np.float64))
    views = np.concatenate(given) if given else None
    if views is None and args.viewpoints is None and args.seen_up is None and cloud is not None:
        views = own_viewpoints(cloud, console)
    seen = None if args.seen_from is None else _column(args.seen_from, cloud)
    # Said now rather than after the cloud is prepared.
    sensors_of(views, seen, args.seen_up)
    return {"viewpoints": views, "seen_from": seen, "up": args.seen_up}


def _column(name: str, cloud: CloudFile | None) -> NDArray[np.intp]:
    """Read rows (n,) of viewpoints from a column of the cloud; formats of text have all numbers as real ones."""
    if cloud is None:
        raise ValueError("--seen-from needs a cloud with columns, in one piece: more --max-memory, and no --resume")
    if name not in cloud.attributes:
        found = ", ".join(cloud.attributes) or "none"
        raise ValueError(f"--seen-from must name a column of the input, found {name!r}; there are {found}")
    values = cloud.attributes[name]
    rows = values.astype(np.intp) if values.ndim == 1 and values.dtype.kind in "iuf" else None
    if rows is None or not np.array_equal(rows, values):
        raise ValueError(f"--seen-from must name a column of whole numbers, found {name!r} of {values.dtype}")
    return rows


def own_viewpoints(cloud: CloudFile, console: Console) -> NDArray[np.float64] | None:
    """Return the viewpoints (k, 3) that a file holds, and say so; None where it holds none."""
    if cloud.viewpoints is not None and not console.quiet:
        console.note(f"face: the file says where it was seen from: {_said(cloud.viewpoints)}")
    return cloud.viewpoints


def _said(views: NDArray[Any]) -> str:
    if len(views) > 1:
        return f"{len(views):,} viewpoints"
    return ", ".join(f"{value:g}" for value in views[0])


def _position(text: str) -> tuple[float, ...]:
    words = tuple(float(word) for word in text.split(","))
    if len(words) != 3 or not np.isfinite(words).all():
        raise ValueError
    return words


def _direction(text: str) -> tuple[float, ...]:
    sign, axis = (-1.0, text[1:]) if text[:1] == "-" else (1.0, text.removeprefix("+"))
    if axis in _AXES:
        return tuple(sign * value for value in _AXES[axis])
    vector = _position(text)
    if not any(vector):
        raise ValueError
    return vector


# Shown by argparse where the text is something else.
_position.__name__ = "position x,y,z"
_direction.__name__ = "direction: x, y, z, -x, -y, -z or x,y,z"
