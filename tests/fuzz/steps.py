"""What tells the package what to do, with some bytes changed: chains, sculpts, MeshLab's scripts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from test_io_mutations import mutated

from face_plugin.adapters.pymeshlab.script import read_steps
from face_plugin.filters import Chain
from face_plugin.sculpt import SculptFile

CHAIN = b"""{"steps": [{"filter": "thin", "distance": 0.01}, {"filter": "normals", "alpha": "dense", "seed": 3},
{"filter": "sculpt", "file": "a.json"}, {"filter": "interior"}, {"filter": "surface", "depth": 7}]}"""
TOML = b"""[[steps]]
filter = "normals"
cage_spacing = 0.1
[[steps]]
filter = "surface"
trim = 0.1
"""
SCULPT = b"""{"version": 1, "charges": [[0.0, 0.5, 0.7], [1, 2, 3]],
"cage_points": [{"position": [0, 0, 1], "radius": 0.1}, {"position": [0, 0, 2], "radius": null}]}"""
SCRIPT = b"""<!DOCTYPE FilterScript>
<FilterScript><filter name="Compute Normal by Faraday Cage">
<Param type="RichFloat" name="alpha" value="0.01" description="Alpha" tooltip=""/></filter></FilterScript>"""
FILES: dict[str, tuple[Callable[[Path], Any], bytes]] = {
    "chain.json": (Chain.load, CHAIN),
    "chain.toml": (Chain.load, TOML),
    "sculpt.json": (SculptFile.load, SCULPT),
    "script.mlx": (read_steps, SCRIPT),
    "nested.json": (SculptFile.load, b"[" * 100_000),
    "nested_chain.json": (Chain.load, b'{"steps": ' + b"[" * 100_000),
}


def case(seed: int, folder: Path) -> str:
    rng = np.random.default_rng([seed, 5])
    name = str(rng.choice(list(FILES)))
    load, content = FILES[name]
    path = folder / name
    path.write_bytes(mutated(content, rng))
    try:
        load(path)
    except ValueError as error:
        assert str(path) in str(error), str(error)
        return "refused by name"
    return "read"
