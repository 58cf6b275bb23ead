"""The command line, `face`. A subcommand is a module of this package with a function `register`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

# Everything else is imported once `main` listens to signals.
from face_plugin.app.cli.signals import STOPPED, listening

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from face_plugin.app.cli.console import Console

__all__ = ["build_parser", "main"]

COMMANDS = ("normals", "mesh", "ribbons", "info", "plot", "view", "chain", "script", "example")

FAILED, BAD_INPUT, MISSING = 1, 2, 3
EXIT_CODES = """exit codes:
  0    done
  1    the method failed on this input
  2    bad usage or bad input: an unknown option, an unreadable or malformed file, a value out of range; or no place to
       write to: a full disk, a closed or full standard output, another run writing the same file
  3    an optional package is missing; the message says how to install it
  130  interrupted (Ctrl-C); no half-written file is left
  143  terminated (SIGTERM), likewise
"""


def build_parser() -> argparse.ArgumentParser:
    """Make the parser of `face` with all subcommands.

    Examples
    --------
    >>> build_parser().parse_args(["mesh", "in.ply", "-o", "out.ply"]).command
    'mesh'
    """
    import argparse
    from importlib import import_module

    from face_plugin import __version__

    parser = argparse.ArgumentParser(
        prog="face",
        description="Outward normals and closed surfaces of unoriented points, by Faraday cage estimation.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"face {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name in COMMANDS:
        import_module(f"face_plugin.app.cli.{name}").register(commands)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run `face` with these arguments (by default the process's own) and return its exit code.

    Examples
    --------
    >>> main(["info", "no-such-file.ply", "--quiet"])
    2
    """
    with listening() as heard:
        try:
            return _main(argv, heard)
        except BaseException:
            # Before the run began, or for the second time.
            if not heard:
                raise
            message, code = STOPPED[heard[0]]
            if sys.stderr is not None:
                sys.stderr.write(f"face: error: {message}\n")
            return code


def _main(argv: Sequence[str] | None, heard: list[int]) -> int:
    """Parse the arguments and run the command, whatever the standard streams are like."""
    from contextlib import redirect_stderr
    from typing import TextIO, cast

    from face_plugin.app.cli.console import Console
    from face_plugin.app.cli.sensors import joined
    from face_plugin.app.cli.streams import Unfailing, fill_closed, guarded_stdout, settle_stdout

    fill_closed()
    with redirect_stderr(cast(TextIO, Unfailing(sys.stderr))):
        try:
            try:
                args = build_parser().parse_args(joined(sys.argv[1:] if argv is None else argv))
            except SystemExit as stop:
                # argparse has said what was wrong (2), or printed its help or version (0).
                settle_stdout()
                return stop.code if isinstance(stop.code, int) else BAD_INPUT
            with (
                guarded_stdout() as write,
                Console(args.command, args.verbose, args.quiet, args.json, write) as console,
            ):
                return _run(args, console, heard)
        except OSError as error:
            if error.filename != "standard output":
                raise
            sys.stderr.write(f"face: error: {error.filename}: {error.strerror}\n")
            return BAD_INPUT
        finally:
            sys.stderr.flush()


def _run(args: argparse.Namespace, console: Console, heard: list[int]) -> int:
    from face_plugin.errors import FaceError, MissingDependencyError

    console.heard = heard
    try:
        summary, text = args.run(args, console)
        console.report(summary, text)
        return 0
    except BaseException as error:
        if heard:
            return console.fail(*STOPPED[heard[0]])
        if isinstance(error, MissingDependencyError):
            return _fail(console, error, MISSING)
        if isinstance(error, (FaceError, MemoryError)):
            return _fail(console, error, FAILED)
        if isinstance(error, (ValueError, OSError)):
            return _fail(console, error, BAD_INPUT)
        raise


def _fail(console: Console, error: BaseException, code: int) -> int:
    if console.verbose:
        import traceback

        console.note(traceback.format_exc())
    message = str(error) or ("not enough memory" if isinstance(error, MemoryError) else type(error).__name__)
    if isinstance(error, OSError) and error.strerror and error.filename:
        message = f"{error.filename}: {error.strerror}"
    return console.fail(message, code)
