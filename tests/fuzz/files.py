"""Files of every format that is read, with some bytes changed."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from test_io_mutations import FILES, mutated

from face_plugin.io import CLOUD_SUFFIXES, read_cloud, write_cloud


def read_mutated(path: Path, content: bytes, rng: np.random.Generator) -> str:
    """Change some bytes, read, and write again what is read."""
    path.write_bytes(mutated(content, rng))
    # NumPy parses headers as Python, and asks in front of everybody what was meant by 0x1if.
    warnings.simplefilter("ignore", SyntaxWarning)
    try:
        cloud = read_cloud(path)
    except ValueError as error:
        assert str(path) in str(error), str(error)
        return "refused by name"
    if path.suffix in CLOUD_SUFFIXES:
        keep = rng.random(len(cloud)) < 0.7
        write_cloud(path, cloud, normals=np.zeros_like(cloud.points), keep=keep)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    return "read"


def case(seed: int, folder: Path) -> str:
    rng = np.random.default_rng([seed, 2])
    name = str(rng.choice(sorted(FILES)))
    content = FILES[name]
    content = content() if callable(content) else content
    return read_mutated(folder / name, content if isinstance(content, bytes) else content.encode(), rng)
