"""`face` and what can happen to it: killed, interrupted, no room, no right to write, no streams, two at once."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from face_plugin import Execution, estimate_normals, shapes
from face_plugin.io import read_cloud

POINTS = shapes.sphere(2500).points
FORMATS = (".npy", ".ply", ".las", ".laz", ".xyz", ".pcd", ".obj", ".npz")
IN_PARTS = FORMATS[:4]
OLD = b"what was there"
# Says that it listens: what comes before, while Python starts, is Python's.
PROGRAM = (
    "import sys; from face_plugin.app.cli import main; sys.stderr.write('ready\\n'); sys.stderr.flush(); "
    "code = main(sys.argv[1:]); sys.stderr.write('done\\n'); sys.exit(code)"
)
STOPPED = {signal.SIGINT: (130,), signal.SIGTERM: (143,), signal.SIGKILL: (-signal.SIGKILL,)}


@contextmanager
def disk(folder: Path, size: int, *, writable: bool = True) -> Iterator[bool]:
    """Put a disk of `size` kB in the place of a folder, if this process has the right to."""
    options = f"size={size}k" + ("" if writable else ",ro")
    words = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    mounted = os.geteuid() == 0 and shutil.which("mount") and subprocess.run(words, capture_output=True).returncode == 0
    try:
        yield bool(mounted)
    finally:
        if mounted:
            subprocess.run(["umount", str(folder)], check=True)


def start(words: list[str], **options: object) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        **options,  # type: ignore[call-overload]
    )
    return process


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    _, said = process.communicate()
    assert "Traceback" not in said, said[-600:]
    return process.returncode, said


def check(output: Path, *, whole: bool) -> None:
    """Check that the output is the old one, or the new one and all of it."""
    if not whole and output.read_bytes() == OLD:
        return
    cloud = read_cloud(output)
    assert len(cloud) == len(POINTS)
    if cloud.normals is not None:
        np.testing.assert_allclose(np.linalg.norm(cloud.normals.astype(float), axis=1), 1, atol=1e-3)


def prepare() -> None:
    for tiles in (None, 1250):
        estimate_normals(POINTS, execution=Execution(tile_points=tiles, engine="serial"))


def case(seed: int, folder: Path) -> str:
    rng = np.random.default_rng([seed, 4])
    place = folder / "place"
    place.mkdir()
    np.save(folder / "in.npy", POINTS)
    output = place / f"out{rng.choice(FORMATS)}"
    words = ["normals", str(folder / "in.npy"), "-o", str(output), "--quiet"]
    in_parts = output.suffix in IN_PARTS and rng.random() < 0.7
    if in_parts or rng.random() < 0.3:
        words += ["--tile-points", "1250", "--engine", str(rng.choice(["serial", "processes"])), "--workers", "2"]
    words += ["--resume"] if in_parts else []
    fault = str(rng.choice(["stopped", "full", "limit", "temporary", "read-only", "streams", "two"]))
    size = int(10 ** rng.uniform(1.5, 3.5))
    if fault in ("full", "read-only"):
        with disk(place, size, writable=fault == "full") as there:
            if not there:
                return "no right to mount"
            if fault == "full":
                output.write_bytes(OLD)
            code, said = ended(start(words))
            assert code in (0, 2), (code, said)
            assert code == 0 or str(place) in said, said
            if fault == "full":
                check(output, whole=code == 0)
        return f"{fault}, exit code {code}"
    output.write_bytes(OLD)
    kept = [f".{output.name}.face"] if in_parts else []
    if fault == "stopped":
        number = [signal.SIGINT, signal.SIGTERM, signal.SIGKILL][rng.integers(3)]
        process = start(words, preexec_fn=partial(signal.signal, signal.SIGINT, signal.default_int_handler))
        assert process.stderr is not None
        assert process.stderr.readline() == "ready\n"
        time.sleep(float(rng.uniform(0.01, 3)))
        process.send_signal(number)
        code, said = ended(process)
        done = "done" in said
        assert code in (0, -number, *STOPPED[number]) if done else code in STOPPED[number], (code, said)
        if number == signal.SIGKILL:
            # Nobody was there to tidy up.
            kept += [path.name for path in place.glob(".out*")]
    elif fault == "limit":
        code, said = ended(
            start(words, preexec_fn=partial(resource.setrlimit, resource.RLIMIT_FSIZE, (size * 1000,) * 2))
        )
        assert code in (0, 2), (code, said)
        assert code == 0 or str(output) in said or "/face-" in said, said
    elif fault == "temporary":
        (folder / "tmp").mkdir()
        with disk(folder / "tmp", size):
            code, said = ended(start(words, env={**os.environ, "TMPDIR": str(folder / "tmp")}))
        assert code in (0, 2), (code, said)
        assert code == 0 or str(folder) in said, said
    elif fault == "streams":
        with open("/dev/full", "w") as full:
            closed = [number for number in (0, 1) if rng.random() < 0.5]
            process = subprocess.Popen(
                [sys.executable, "-m", "face_plugin.app.cli", *words[: rng.choice([-1, len(words)])]],
                stdout=full,
                stderr=full,
                preexec_fn=lambda: [os.close(number) for number in closed] and None,
            )
        code = process.wait()
        assert code in (0, 2), code
    else:
        pair = [start(words), None]
        time.sleep(float(rng.uniform(0, 2)))
        pair[1] = start(words)
        codes = [ended(process) for process in pair if process is not None]
        assert all(code == 0 or (code == 2 and f"another run is writing {output}" in said) for code, said in codes), (
            codes
        )
        code = max(code for code, _ in codes)
        assert min(code for code, _ in codes) == 0
    check(output, whole=False)
    left = set(os.listdir(place)) - {output.name, *kept}
    assert not left, f"left behind: {left}"
    again, said = ended(start(words))
    assert again == 0, said
    check(output, whole=True)
    return f"{fault}, exit code {code}"
