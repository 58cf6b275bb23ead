"""Processes of their own for libraries that may end the one they run in."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys

__all__ = ["environment", "failure", "limit_memory"]


def environment() -> dict[str, str]:
    """Copy the environment, with this process's module path: the child must find the same packages.

    Examples
    --------
    >>> environment()["PYTHONSAFEPATH"]
    '1'
    """
    path = os.pathsep.join(map(os.path.abspath, sys.path))
    # Without the safe path a file of the library's name in the working directory would be imported instead.
    return {**os.environ, "PYTHONPATH": path, "PYTHONSAFEPATH": "1"}


def failure(child: subprocess.CompletedProcess[str]) -> str:
    r"""Say in a few words how a child ended that did not end well; its standard error is captured text.

    Examples
    --------
    >>> failure(subprocess.CompletedProcess([], 1, "", "Traceback\nValueError: no"))
    'failed (ValueError: no)'
    """
    lines = [line.strip() for line in child.stderr.splitlines() if line.strip()]
    if child.returncode < 0:
        return f"crashed (signal {-child.returncode}{': ' + lines[0] if lines else ''})"
    return f"failed ({lines[-1] if lines else f'exit code {child.returncode}'})"


def limit_memory(size: int) -> None:
    """Let this process's allocations beyond `size` bytes fail, where the system can do that.

    Parameters
    ----------
    size : int
        Bytes beside what the interpreter and its libraries have mapped already.
    """
    with contextlib.suppress(ImportError, ValueError, OSError, OverflowError):
        import resource

        with open("/proc/self/statm") as statm:
            mapped = int(statm.read().split()[0]) * resource.getpagesize()
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        wanted = size + mapped
        # A limit that the user has set stays one.
        resource.setrlimit(resource.RLIMIT_AS, (wanted if soft == resource.RLIM_INFINITY else min(wanted, soft), hard))
