"""Options that several subcommands share; the settings are made from the fields of `Params` and `Execution`."""

from __future__ import annotations

import argparse
import ast
import dataclasses
import inspect
import textwrap
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from face_plugin.app.cli.console import Console
from face_plugin.errors import require
from face_plugin.execution import Execution
from face_plugin.io import READ_SUFFIXES
from face_plugin.params import Params

__all__ = [
    "Command",
    "add_command",
    "add_interior",
    "add_method",
    "add_sculpt",
    "add_surface",
    "execution_of",
    "params_of",
    "surface_of",
]

Command = Callable[[argparse.Namespace, Console], "tuple[dict[str, Any], str]"]


def add_command(
    commands: Any,
    name: str,
    run: Command,
    help: str,
    *,
    output: str | None = None,
    inputs: str | None = "point cloud",
    suffixes: tuple[str, ...] = READ_SUFFIXES,
) -> argparse.ArgumentParser:
    """Add a subcommand with what all of them have: the input, the output, and how much to say.

    Parameters
    ----------
    commands
        What `register` was given.
    name, help : str
    run : callable
        Takes the arguments and the `Console`; returns the summary for ``--json`` and the text for a reader.
    output : str, optional
        What ``-o`` writes; None: nothing.
    inputs : str, optional
        What the input is; None: there is none.
    suffixes : tuple of str
        Extensions that it may have.
    """
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=help, description=help, epilog="exit codes: see face --help"
    )
    if inputs is not None:
        parser.add_argument("input", metavar="IN", type=Path, help=f"{inputs} ({', '.join(suffixes)})")
    if output is not None:
        parser.add_argument("-o", "--output", metavar="OUT", type=Path, required=True, help=output)
    parser.add_argument("--json", action="store_true", help="print a summary as JSON, and nothing else, on stdout")
    volume = parser.add_mutually_exclusive_group()
    volume.add_argument("-v", "--verbose", action="store_true", help="say more; show where an error comes from")
    volume.add_argument("--quiet", action="store_true", help="say nothing but errors")
    parser.set_defaults(run=run)
    return parser


def add_method(parser: argparse.ArgumentParser) -> None:
    """Add one option for each field of `Params` and `Execution`, with its own type, choices and description."""
    group = parser.add_argument_group("settings of the method")
    group.add_argument("--paper", action="store_true", help="start from the settings of the paper (needs tetgen)")
    _add_fields(group, Params)
    _add_fields(parser.add_argument_group("settings of its execution"), Execution)


def _add_fields(group: Any, settings: type[Params | Execution]) -> None:
    hints, texts = get_type_hints(settings), _descriptions(settings)
    for field in dataclasses.fields(settings):
        # Nobody can write None in a shell: it is what is not given.
        said = texts.get(field.name, "").replace("None = ", "if not given, ")
        default = "from the data" if field.default is None else field.default
        text = f"{said} [default: {default}]".strip().replace("%", "%%")
        flag = "--" + field.name.replace("_", "-")
        group.add_argument(flag, dest=f"setting_{field.name}", help=text, **_kind(hints[field.name]))


def params_of(args: argparse.Namespace) -> Params:
    """Make `Params` of the options that were given."""
    given = _given(args, Params)
    return Params.paper(**given) if args.paper else Params(**given)


def execution_of(args: argparse.Namespace) -> Execution:
    """Make `Execution` of the options that were given."""
    return Execution(**_given(args, Execution))


def _given(args: argparse.Namespace, settings: type[Params | Execution]) -> dict[str, Any]:
    found = {field.name: getattr(args, f"setting_{field.name}") for field in dataclasses.fields(settings)}
    return {name: value for name, value in found.items() if value is not None}


def _kind(hint: Any) -> dict[str, Any]:
    """Say to argparse how a value of this type is written."""
    parts = [part for part in _alternatives(hint) if part is not NoneType]
    names = [name for part in parts if get_origin(part) is Literal for name in get_args(part)]
    numbers = [part for part in parts if part in (int, float)]
    if str in parts:
        return {"metavar": "NAME"}
    if not numbers:
        return {"choices": names}
    if not names:
        return {"type": numbers[0], "metavar": "N" if numbers[0] is int else "X"}

    def number_or_name(text: str) -> Any:
        return text if text in names else numbers[0](text)

    # Shown by argparse where the text is neither.
    number_or_name.__name__ = f"number or {'|'.join(names)}"
    return {"type": number_or_name, "metavar": f"X|{'|'.join(names)}"}


def _alternatives(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _descriptions(settings: type) -> dict[str, str]:
    """Read the text under each field: it is written once, there."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(settings)))
    except OSError:
        return {}
    body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
    texts = {}
    for field, text in pairwise(body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(text, ast.Expr):
            value = text.value.value if isinstance(text.value, ast.Constant) else ""
            texts[field.target.id] = " ".join(str(value).split()).rstrip(".")
    return texts


def add_interior(parser: argparse.ArgumentParser, *, default: bool) -> None:
    """Add ``--filter-interior`` and its opposite."""
    parser.add_argument(
        "--filter-interior",
        action=argparse.BooleanOptionalAction,
        default=default,
        help="leave out the points inside the object",
    )


def add_sculpt(parser: argparse.ArgumentParser) -> None:
    """Add ``--sculpt``."""
    parser.add_argument(
        "--sculpt", metavar="JSON", type=Path, help="carve and shield as this file of point charges says"
    )


def add_surface(parser: argparse.ArgumentParser) -> None:
    """Add the options of Poisson surface reconstruction."""
    from face_plugin.surface import BACKENDS, DEPTHS

    group = parser.add_argument_group("surface")
    depths = (None, *range(DEPTHS[0], DEPTHS[1] + 1))
    group.add_argument(
        "--depth",
        type=_depth,
        choices=depths,
        default=8,
        metavar="N|auto",
        help="depth of the octree; auto = from the spacing of the points [default: 8]",
    )
    group.add_argument(
        "--unscreened",
        action="store_true",
        help="the smoother variant, which does not pass through the points",
    )
    group.add_argument("--backend", choices=BACKENDS, help="who reconstructs [default: whichever is installed]")
    group.add_argument(
        "--trim",
        type=float,
        default=0.0,
        metavar="F",
        help="drop this fraction of the vertices, the least dense",
    )
    group.add_argument(
        "--trim-distance",
        type=_distance,
        default="auto",
        metavar="X|auto|none",
        help="cut the surface farther than X spacings from the points; auto = 2 where the scan is open [default: auto]",
    )


def _distance(text: str) -> float | str | None:
    return None if text == "none" else text if text == "auto" else float(text)


_distance.__name__ = "number, auto or none"


def _depth(text: str) -> int | None:
    return None if text == "auto" else int(text)


_depth.__name__ = "number or auto"


def surface_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `add_surface` as keywords of the library; a backend must be installed."""
    if args.backend is not None:
        # Said now rather than after the computation.
        require(args.backend, extra=args.backend)
    return {
        "depth": args.depth,
        "screened": not args.unscreened,
        "backend": args.backend,
        "trim": args.trim,
        "trim_distance": args.trim_distance,
    }
