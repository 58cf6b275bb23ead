"""A little of `make fuzz`, and that it sees what it is there to see."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).parent / "fuzz"


def load():
    spec = importlib.util.spec_from_file_location("fuzz_main", FUZZ / "__main__.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SLOW = [pytest.param(kind, 2, marks=pytest.mark.slow) for kind in ("faults", "threads", "lost")]


@pytest.mark.parametrize(("kind", "cases"), [("clouds", 16), ("files", 60), ("steps", 100), ("packed", 4), *SLOW])
def test_some_cases(kind, cases):
    words = [sys.executable, str(FUZZ), "--cases", str(cases), "--kind", kind]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert f"{cases} cases, 0 failed" in done.stdout


def test_what_fails_crashes_or_hangs_is_seen(tmp_path, monkeypatch, capsys):
    """And the cases after it are run."""
    (tmp_path / "clouds.py").write_text("""
import os, time
def case(seed, folder):
    assert seed != 1, "one: is wrong"
    if seed == 3:
        os.kill(os.getpid(), 11)
    if seed == 5:
        time.sleep(100)
    return "fine"
""")
    (tmp_path / "__main__.py").write_text((FUZZ / "__main__.py").read_text())
    module = load()
    monkeypatch.setattr(module, "HERE", tmp_path)
    monkeypatch.setattr(module, "HANG", 3.0)
    monkeypatch.setattr(sys, "argv", ["fuzz", "--cases", "8", "--kind", "clouds"])
    assert module.main() == 1
    said = capsys.readouterr().out
    assert "clouds 1 FAILED AssertionError at clouds.py:4: one: is wrong\n" in said
    assert "clouds 3 FAILED ends the process with code -11\n" in said
    assert "clouds 5 FAILED hangs\n" in said
    assert "5 clouds   fine\n" in said
    assert "8 cases, 3 failed" in said
