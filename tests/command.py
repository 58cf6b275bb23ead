"""The `face` command, called as a person calls it."""

from __future__ import annotations

import pytest

from face_plugin.app.cli import main


def run(capfd: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = main([str(word) for word in words])
    out, err = capfd.readouterr()
    return code, out, err
