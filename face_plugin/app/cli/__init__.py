"""The command line, `face`. A subcommand is a module of this package with a function `register`."""

from __future__ import annotations

import argparse
import signal
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import FrameType

from face_plugin import __version__
from face_plugin.app.cli.console import Console, guarded_stdout
from face_plugin.errors import FaceError, MissingDependencyError

__all__ = ["build_parser", "main"]

COMMANDS = ("normals", "mesh", "ribbons", "info", "plot", "view", "chain", "script")

FAILED, BAD_INPUT, MISSING, INTERRUPTED, TERMINATED = 1, 2, 3, 130, 143
EXIT_CODES = """exit codes:
  0    done
  1    the method failed on this input
  2    bad usage or bad input: an unknown option, an unreadable or malformed file, a value out of range
  3    an optional package is missing; the message says how to install it
  130  interrupted (Ctrl-C); no half-written file is left
"""


def build_parser() -> argparse.ArgumentParser:
    """Make the parser of `face` with all subcommands.

    Examples
    --------
    >>> build_parser().parse_args(["mesh", "in.ply", "-o", "out.ply"]).command
    'mesh'
    """
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
    try:
        args = build_parser().parse_args(argv)
        with (
            guarded_stdout() as write,
            _sigterm_raises(),
            Console(args.command, args.verbose, args.quiet, args.json, write) as console,
        ):
            return _run(args, console)
    except SystemExit as stop:
        # argparse has said what was wrong (2), or printed its help or version (0).
        return stop.code if isinstance(stop.code, int) else BAD_INPUT
    except KeyboardInterrupt:
        # Before the run began, or for the second time.
        return INTERRUPTED


def _run(args: argparse.Namespace, console: Console) -> int:
    try:
        summary, text = args.run(args, console)
        console.report(summary, text)
        return 0
    except KeyboardInterrupt:
        return console.fail("interrupted", INTERRUPTED)
    except _Terminated:
        return console.fail("terminated", TERMINATED)
    except MissingDependencyError as error:
        return _fail(console, error, MISSING)
    except (FaceError, MemoryError) as error:
        return _fail(console, error, FAILED)
    except (ValueError, OSError) as error:
        return _fail(console, error, BAD_INPUT)


def _fail(console: Console, error: BaseException, code: int) -> int:
    if console.verbose:
        console.note(traceback.format_exc())
    message = str(error) or ("not enough memory" if isinstance(error, MemoryError) else type(error).__name__)
    if isinstance(error, OSError) and error.strerror and error.filename:
        message = f"{error.filename}: {error.strerror}"
    return console.fail(message, code)


class _Terminated(BaseException):
    """SIGTERM, as an exception: what is open is closed and temporary files are removed."""


@contextmanager
def _sigterm_raises() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        # Only the main thread can be told of signals.
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        raise _Terminated

    previous = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)
