"""What README and docs print runs as printed, and their links lead somewhere."""

import importlib
import re
from pathlib import Path

import pytest

import face_plugin
from face_plugin import examples
from face_plugin.adapters import pymeshlab
from face_plugin.app.cli import main

ROOT = Path(__file__).parents[1]
API = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", ["README.md", "docs/which-side.md"])
def test_python_runs_as_printed(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # Samples of a few points: what is shown is that the lines run.
    monkeypatch.setattr(examples, "POINTS", 500)
    monkeypatch.setattr(examples.load, "__defaults__", (500, 0))
    assert main(["example", "object", "-o", "scan.ply", "--points", "500", "--quiet"]) == 0
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 3
    names: dict[str, object] = {}
    try:
        for block in blocks:
            exec(compile(block, page, "exec"), names)
    finally:
        # What a reader registers in the hosts, other tests must not find.
        pymeshlab.unregister()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    targets = [target.split("#")[0] for target in re.findall(r"\]\(([^)\s]+)\)", text)]
    missing = [target for target in targets if target and "://" not in target and not (page.parent / target).exists()]
    assert missing == []


def test_every_example_is_in_the_gallery():
    gallery = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    shown = re.findall(r"<!-- source: (\w+\.py) -->", gallery)
    # The others only draw for these.
    assert sorted([*shown, "panels.py", "sculpt_panels.py"]) == sorted(
        path.name for path in (ROOT / "examples").glob("*.py")
    )


@pytest.mark.parametrize("module", re.findall(r"^## .*`(\S+)`", API, re.MULTILINE))
def test_every_public_name_is_listed_and_no_other(module):
    section = API.split(f"`{module}`\n")[1].split("\n## ")[0]
    listed = re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)
    assert sorted(listed) == sorted(importlib.import_module(module).__all__)


def test_the_version_is_the_same_everywhere():
    release = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    project = re.search(r'^version = "(.+)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE)
    citation = re.search(r"^version: (\S+)", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert [found and found[1] for found in (release, project, citation)] == [face_plugin.__version__] * 3
