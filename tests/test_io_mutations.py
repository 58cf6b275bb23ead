"""Files with a few bytes changed: they are read, or a ValueError names them; nothing else happens."""

from __future__ import annotations

from pathlib import Path

import io_files as made
import numpy as np
import pytest

from face_plugin.io import CLOUD_SUFFIXES, read_cloud, write_cloud

FILES = {**made.TEXT, **made.COLOURED, **made.BINARY}
TOKENS = [b"0", b"-1", b"1e400", b"nan", b"9" * 20, b"\xff", b"\0", b"\n", b" ", b",", b";", b'"', b"a", b"#", b"\r"]
# Changes near the beginning hit headers.
HEADER = 400
MUTATIONS = 12
"""For each file; the seeds are the same each time."""


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """Change, insert, repeat and cut at one to four places."""
    out = bytearray(content)
    for _ in range(rng.integers(1, 5)):
        reach = min(len(out), HEADER) if rng.random() < 0.6 else len(out)
        at = int(rng.integers(max(reach, 1)))
        token = TOKENS[rng.integers(len(TOKENS))]
        match int(rng.integers(5)):
            case 0:
                out[at : at + 1] = bytes([rng.integers(256)])
            case 1:
                out[at : at + int(rng.integers(1, 9))] = b""
            case 2:
                out[at:at] = token
            case 3:
                out[at:at] = out[at // 2 : at // 2 + int(rng.integers(1, 60))]
            case 4:
                out[at : at + len(token)] = token
    return bytes(out) if rng.random() < 0.9 else bytes(out[: rng.integers(len(out) + 1)])


@pytest.mark.filterwarnings("ignore::SyntaxWarning")  # NumPy parses headers as Python
@pytest.mark.parametrize("name", FILES)
def test_mutations(tmp_path: Path, name: str) -> None:
    content = FILES[name]
    content = content() if callable(content) else content
    content = content if isinstance(content, bytes) else content.encode()
    path = tmp_path / name
    for seed in range(MUTATIONS):
        rng = np.random.default_rng([seed, *name.encode()])
        path.write_bytes(mutated(content, rng))
        cloud, message = None, ""
        try:
            cloud = read_cloud(path)
        except ValueError as error:
            message = str(error)
        if cloud is None:
            assert str(path) in message
        elif path.suffix in CLOUD_SUFFIXES:
            write_cloud(path, cloud, normals=np.zeros((len(cloud), 3)), keep=rng.random(len(cloud)) < 0.7)
