"""MeshLab filter scripts (.mlx), and the one that every MeshSet keeps of what was applied to it."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

__all__ = ["Element", "apply_host_step", "check_steps", "kept_script", "load_steps", "read_steps", "steps_of"]

Element = ElementTree.Element
WRITERS = {
    "NXS Build",
    "NXS Compress",
    "Export to Sketchfab",
    "Export active rasters cameras to file",
    "GPU Filter Example",
}
"""MeshLab's filters that write a file of any name, or send the layer to a server."""


def read_steps(path: str | os.PathLike[str]) -> list[Element]:
    """Return the ``filter`` elements of a script.

    Raises
    ------
    ValueError
        The file is no filter script; the host would take it for an empty one.
    OSError
        The file cannot be read; the host would print that and go on.
    """
    data = Path(path).read_bytes()
    try:
        root = ElementTree.fromstring(data.decode("utf-8-sig"))
    except (ElementTree.ParseError, ValueError) as error:
        raise ValueError(f"{path}: not a MeshLab filter script: {error}") from None
    if root.tag != "FilterScript":
        raise ValueError(f"{path}: not a MeshLab filter script: holds <{root.tag}>")
    return root.findall("filter")


def check_steps(path: str | os.PathLike[str], steps: Sequence[Element]) -> None:
    """Refuse a script of whoever wrote it that writes elsewhere than the one who runs it said.

    Raises
    ------
    ValueError
        A step is one of `WRITERS`.
    """
    for number, step in enumerate(steps, 1):
        if step.get("name") in WRITERS:
            raise ValueError(
                f"{path}: step {number} ({step.get('name')}) writes or sends files of its own, which a script may not; "
                "apply that filter in Python"
            )


def steps_of(ms: Any) -> list[Element]:
    """Return the steps of the MeshSet's own script."""
    with _scratch_file() as path:
        ms.save_filter_script(str(path))
        return read_steps(path)


def load_steps(ms: Any, steps: Sequence[Element]) -> None:
    """Make these steps the MeshSet's own script; it takes and saves filters that it does not know."""
    root = Element("FilterScript")
    for step in steps:
        root.append(step)
    ElementTree.indent(root, " ")
    with _scratch_file() as path, _quiet():
        path.write_text("<!DOCTYPE FilterScript>\n" + ElementTree.tostring(root, "unicode"), encoding="utf-8")
        ms.load_filter_script(str(path))


def apply_host_step(ms: Any, step: Element, apply_script: Any) -> None:
    """Let the host run one step of its own."""
    load_steps(ms, [step])
    apply_script(ms)


@contextmanager
def kept_script(ms: Any, step: Element) -> Iterator[None]:
    """Record what runs in the block as one step, not as the filters of the host that it is made of."""
    before = steps_of(ms)
    try:
        yield
    except BaseException:
        load_steps(ms, before)
        raise
    load_steps(ms, [*before, step])


@contextmanager
def _scratch_file() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder) / "script.mlx"


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep stderr clean: the host prints each filter name that it reads, whatever its verbosity."""
    try:
        sys.stderr.flush()
        saved = os.dup(2)
    except (AttributeError, OSError):  # no stderr, as under pythonw: nothing to keep clean
        yield
        return
    try:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 2)
        os.close(null)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
