"""Loops that numba compiles: the one place that decides whether they are cached, and that says so when they are not."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numba
from numba.core import event

__all__ = ["compiled"]

log = logging.getLogger(__name__)


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function at its first call, and keep the machine code for later processes where there is a folder.

    Kernels are plain loops over scalars and given arrays: array expressions, `np.zeros` and their like, and slices
    take numba five to ten times as long to compile.

    Parameters
    ----------
    **options
        Of `numba.njit`, such as `nogil`, `fastmath`, `boundscheck` or `error_model`.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return numba.njit(cache=True, **options)(function)
        except RuntimeError as error:
            # On a read-only disk without a home numba finds no folder, and refuses.
            if "cannot cache" not in str(error):
                raise
            _warn_once()
            return numba.njit(**options)(function)

    return decorate


_said: set[str] = set()


def _warn_once() -> None:
    if "uncached" not in _said:
        _said.add("uncached")
        log.warning(
            "no folder to keep compiled code in: every process compiles anew, which takes seconds; "
            "set NUMBA_CACHE_DIR to a folder that can be written"
        )


class _Listener(event.Listener):
    """Says once that code is being compiled; code that comes from the cache causes no such event."""

    def on_start(self, event: Any) -> None:
        """Hear from numba that it begins to compile a function, of any package."""
        module = event.data["dispatcher"].py_func.__module__ or ""
        if module.split(".")[0] == __name__.split(".")[0] and "compiling" not in _said:
            _said.add("compiling")
            kept = "" if "uncached" in _said else ", once"
            log.info("compiling code for this machine%s: a few seconds", kept)

    def on_end(self, event: Any) -> None:
        """Hear from numba that it has done so."""


event.register("numba:compile", _Listener())  # type: ignore[no-untyped-call]
