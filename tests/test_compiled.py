"""Compiled code: kept where it can be, and said so where it is made or cannot be kept."""

import ast
import logging
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

import face_plugin
from face_plugin import compiled as module
from face_plugin.app.cli.console import Console
from face_plugin.compiled import compiled

# Two kernels, in a file as every kernel is: the second one calls the first.
KERNELS = """
from face_plugin.compiled import compiled

@compiled(error_model="numpy")
def half(x):
    return x / 2.0

@compiled(nogil=True)
def quarter(x):
    return half(half(x))
"""
TALKING = """
import logging
logging.basicConfig(level=logging.INFO)
import face_plugin.kernels_of_a_test as kernels
print(kernels.quarter(2.0), kernels.half(3.0))
"""


@pytest.fixture
def run(tmp_path):
    """Run the kernels in a process of their own, as a module of the package, with a folder for the cache."""
    (tmp_path / "kernels_of_a_test.py").write_text(KERNELS)
    extend = f"import face_plugin\nface_plugin.__path__.append({str(tmp_path)!r})\n"

    def in_process(cache: Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", extend + TALKING],
            env=os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            check=True,
        )

    return in_process


def test_says_once_that_it_compiles_and_never_again_from_the_cache(run, tmp_path):
    first, second = run(tmp_path / "cache"), run(tmp_path / "cache")
    assert first.stdout == second.stdout == "0.5 1.5\n"
    assert first.stderr.count("compiling") == 1
    assert second.stderr == ""


@pytest.fixture
def nowhere(monkeypatch):
    """As on a read-only disk without a home: numba finds no place for its files."""
    monkeypatch.setattr("numba.core.caching.CacheImpl._locator_classes", [])
    monkeypatch.setattr(module, "_said", set())


def test_without_a_folder_it_runs_and_warns_once(nowhere, caplog):
    @compiled()
    def double(x):
        return 2 * x

    @compiled(boundscheck=True)
    def last(values, i):
        return values[i]

    assert double(2) == 4
    with pytest.raises(IndexError):
        last(np.zeros(2), 5)
    (said,) = [r for r in caplog.records if r.levelno == logging.WARNING]
    assert "NUMBA_CACHE_DIR" in said.getMessage()


@pytest.mark.parametrize("quiet", [True, False])
def test_the_command_line_says_so_unless_it_is_to_be_quiet(quiet, capsys):
    with Console("normals", verbose=False, quiet=quiet, as_json=False, write=print):
        logging.getLogger(module.__name__).info("compiling")
        logging.getLogger("face_plugin.other").info("nothing of interest")
    assert capsys.readouterr().err == ("" if quiet else "face: info: compiling\n")
    assert logging.getLogger(module.__name__).level == logging.NOTSET


def test_what_others_compile_is_not_announced(monkeypatch, caplog):
    monkeypatch.setattr(module, "_said", set())
    with caplog.at_level(logging.INFO):
        numba.njit(lambda x: x + 1)(1)
    assert "compiling" not in caplog.text


def test_numba_is_asked_in_one_place_only():
    root = Path(face_plugin.__file__).parent
    asking = [
        path.relative_to(root).as_posix()
        for path in root.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and node.attr in ("njit", "jit", "vectorize", "guvectorize")
    ]
    assert set(asking) == {"compiled.py"}
