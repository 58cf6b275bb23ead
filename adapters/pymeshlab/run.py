"""Our filters among MeshLab's own: in filter scripts, and as methods of every MeshSet."""

from __future__ import annotations

import os
from typing import Any

from face_plugin.adapters.pymeshlab import calls
from face_plugin.adapters.pymeshlab.filters import apply_by_name, apply_step, suggestion
from face_plugin.adapters.pymeshlab.script import (
    Element,
    apply_host_step,
    check_steps,
    load_steps,
    read_steps,
    steps_of,
)
from face_plugin.adapters.pymeshlab.table import FILTERS, python_name
from face_plugin.errors import require

__all__ = ["register", "run_filter_script", "unregister"]

_originals: dict[str, Any] = {}


def run_filter_script(ms: Any, path: str | os.PathLike[str]) -> None:
    """Run a MeshLab filter script (.mlx) in which our filters may stand between MeshLab's own.

    Afterwards it is the MeshSet's own script, as after ``load_filter_script`` and ``apply_filter_script``.

    Raises
    ------
    OSError, ValueError
        The file cannot be read, is no filter script, or has a step of MeshLab's that writes files of its own.
    PyMeshLabException
        A step failed; the message names its number (from 1) and its filter.

    Examples
    --------
    >>> import pathlib, pymeshlab, tempfile
    >>> from face_plugin.shapes import sphere
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "script.mlx"
    >>> step = '<filter name="Compute Normal by Faraday Cage"/>'
    >>> _ = path.write_text(f"<!DOCTYPE FilterScript><FilterScript>{step}</FilterScript>")
    >>> ms = pymeshlab.MeshSet()
    >>> ms.add_mesh(pymeshlab.Mesh(sphere(300).points))
    >>> run_filter_script(ms, path)
    """
    steps = read_steps(path)
    check_steps(path, steps)
    _run(ms, steps, _host("apply_filter_script"))


def register() -> None:
    """Make the filters methods of every MeshSet, known to ``apply_filter`` and ``apply_filter_script``.

    Examples
    --------
    >>> import pymeshlab
    >>> register()
    >>> hasattr(pymeshlab.MeshSet, "compute_normal_by_faraday_cage")
    True
    >>> unregister()
    """
    mesh_set = require("pymeshlab", extra="pymeshlab").MeshSet
    if _originals:
        return
    _originals.update({name: getattr(mesh_set, name) for name in ("apply_filter", "apply_filter_script")})

    def apply_filter(self: Any, filter_name: str, **kwargs: Any) -> dict[str, Any]:
        if "faraday" in filter_name and filter_name not in FILTERS:
            raise require("pymeshlab", extra="pymeshlab").PyMeshLabException(
                f"Failed to apply filter: {filter_name}\nFilter does not exist. {suggestion(filter_name, FILTERS)}"
            )
        if filter_name not in FILTERS:
            result: dict[str, Any] = _originals["apply_filter"](self, filter_name, **kwargs)
            return result
        apply_by_name(self, filter_name, kwargs)
        return {}

    def apply_filter_script(self: Any) -> None:
        steps = steps_of(self)
        if any(python_name(step.get("name", "")) in FILTERS for step in steps):
            _run(self, steps, _originals["apply_filter_script"])
        else:
            _originals["apply_filter_script"](self)

    for method in (apply_filter, apply_filter_script):
        method.__doc__ = _originals[method.__name__].__doc__
        setattr(mesh_set, method.__name__, method)
    for name in FILTERS:
        setattr(mesh_set, name, getattr(calls, name))


def unregister() -> None:
    """Undo `register`; nothing happens where it was not called."""
    if not _originals:
        return
    mesh_set = require("pymeshlab", extra="pymeshlab").MeshSet
    for name, original in _originals.items():
        setattr(mesh_set, name, original)
    for name in FILTERS:
        delattr(mesh_set, name)
    _originals.clear()


def _host(name: str) -> Any:
    return _originals.get(name) or getattr(require("pymeshlab", extra="pymeshlab").MeshSet, name)


def _run(ms: Any, steps: list[Element], apply_script: Any) -> None:
    ml = require("pymeshlab", extra="pymeshlab")
    try:
        for number, step in enumerate(steps, 1):
            title = step.get("name", "")
            name = python_name(title)
            try:
                if name in FILTERS:
                    apply_step(ms, name, step)
                else:
                    apply_host_step(ms, step, apply_script)
            except (ValueError, RuntimeError, ml.PyMeshLabException) as error:
                raise ml.PyMeshLabException(f"step {number} ({title}): {error}") from error
    finally:
        load_steps(ms, steps)
