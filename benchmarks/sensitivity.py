"""What half and double of each constant of the angles and the sides do, on generated clouds, as a Markdown table.

    python benchmarks/sensitivity.py [--modules angles sides] [--points 2000] [--workers 2]

Each constant at the top of a module is changed by itself, in a process of its own, and all clouds are solved. One in
(0.5, 1), such as a cosine or a share, moves half of its way to 1 instead of doubling. Shown are the changes of the
share of normals on the wrong side, of the mean angle of the lines to the truth in degrees, and of the share of points
that are dropped, in percent; constants that change none of them by as much as `NOISE` are named below the table.
"""

from __future__ import annotations

import argparse
import ast
import importlib.machinery
import importlib.util
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import CodeType, ModuleType

import numpy as np

SPEC = importlib.util.find_spec("face_plugin")
assert SPEC is not None
assert SPEC.origin is not None
ROOT = Path(SPEC.origin).parent
NOISE = (0.02, 0.03, 0.02)
"""Changes in percent, degrees and percent that another seed of the clouds makes as well."""
# Points in the plane have constants of their own, and clouds here are in space.
LEFT_OUT = {"curves"}


def constants(folder: str) -> dict[tuple[str, str], object]:
    """Numbers, and tuples of them, at the top of the modules of a folder: by module and name."""
    found: dict[tuple[str, str], object] = {}
    for path in sorted((ROOT / folder).glob("*.py")):
        if path.stem in LEFT_OUT:
            continue
        for node in ast.parse(path.read_text()).body:
            if not isinstance(node, ast.Assign):
                continue
            target = node.targets[0]
            names, values = (target.elts, node.value) if isinstance(target, ast.Tuple) else ([target], node.value)
            several = values.elts if isinstance(target, ast.Tuple) and isinstance(values, ast.Tuple) else [values]
            for name, value in zip(names, several, strict=True):
                try:
                    number = ast.literal_eval(value)
                except ValueError:
                    continue
                numbers = number if isinstance(number, tuple) else (number,)
                if isinstance(name, ast.Name) and name.id.isupper() and all(type(x) in (int, float) for x in numbers):
                    found[f"face_plugin.{folder}.{path.stem}", name.id] = number
    return found


def changed(value: object, factor: float) -> object:
    """Half or double of a number, or of each of several."""
    if isinstance(value, tuple):
        return tuple(changed(one, factor) for one in value)
    if isinstance(value, int):
        return max(1, round(value * factor))
    assert isinstance(value, float)
    return (1 + value) / 2 if factor > 1 and 0.5 < value < 1 else value * factor


class Changing(importlib.machinery.SourceFileLoader):
    """Loads a module with another value of one of its constants."""

    def __init__(self, name: str, path: str, constant: str, value: object) -> None:
        super().__init__(name, path)
        self.constant, self.value = constant, value

    def get_code(self, fullname: str) -> CodeType | None:
        """Compile the changed source."""
        tree, target = ast.parse(Path(self.path).read_text()), self.constant
        for node in tree.body:
            if isinstance(node, ast.Assign):
                place = node.targets[0]
                if isinstance(place, ast.Name) and place.id == target:
                    node.value = ast.parse(repr(self.value), mode="eval").body
                elif isinstance(place, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    for k, name in enumerate(place.elts):
                        if isinstance(name, ast.Name) and name.id == target:
                            node.value.elts[k] = ast.parse(repr(self.value), mode="eval").body
        return compile(ast.fix_missing_locations(tree), self.path, "exec")


class Finder:
    """Finds that module."""

    def __init__(self, module: str, constant: str, value: object) -> None:
        self.change = module, constant, value

    def find_spec(self, name: str, path: object, target: ModuleType | None = None) -> object:
        """Find it there, and leave the others to Python."""
        module, constant, value = self.change
        if name != module:
            return None
        file = str(ROOT.joinpath(*name.split(".")[1:]).with_suffix(".py"))
        return importlib.util.spec_from_loader(name, Changing(name, file, constant, value))


def measured(points: int) -> list[float]:
    """Wrong sides, angle and loss, on the average of all clouds."""
    # The package is loaded here: after a change, or never.
    import truth

    import face_plugin
    from face_plugin import examples, shapes

    clouds = [truth.generated(name, make(points, 0)) for name, make in truth.GENERATED.items()]
    rng = np.random.default_rng(0)
    for scale, name in ((0.5, "noisy"), (1.0, "noisier")):
        ball = shapes.sphere(points)
        spread = scale * np.sqrt(4 * np.pi / points) * rng.normal(size=(points, 1))
        clouds.append(truth.Case(name, ball.points + spread * ball.normals, ball.normals, np.ones(points, bool), False))
    for name in examples.NAMES:
        scan = examples.load(name, points)
        clouds.append(truth.Case(name, scan.points, scan.normals, np.ones(len(scan.points), bool), False))
    found = []
    for case in clouds:
        result = face_plugin.estimate_normals(case.points, filter_interior=True)
        cosine = np.einsum("nd,nd->n", result.normals, case.normals)[case.valid]
        wrong = 100 * float((cosine < 0).mean())
        assert result.interior is not None
        angle = float(np.degrees(np.arccos(np.clip(np.abs(cosine), 0, 1))).mean())
        # What encloses nothing is right on either side.
        found.append((min(wrong, 100 - wrong), angle, 100 * float(result.interior[case.valid].mean())))
    return [float(x) for x in np.mean(found, axis=0)]


def compiled_with(module: str, constant: str) -> set[str]:
    """Names of modules with compiled code that the value may be part of, which Numba would take from its cache."""
    sources = {path: path.read_text() for path in ROOT.rglob("*.py")}
    own = ROOT.joinpath(*module.split(".")[1:]).with_suffix(".py")
    taken = re.compile(rf"from {re.escape(module)} import [^\n]*\b{constant}\b")
    return {p.stem for p, text in sources.items() if "@compiled" in text and (p == own or taken.search(text))}


def run(points: int, change: tuple[str, str, object] | None, kept: str) -> list[float]:
    """Measure in a process of its own; compiled code is that of a folder, but for what has the constant in it."""
    words = [sys.executable, __file__, "--points", str(points), "--change", json.dumps(change)]
    anew = set() if change is None else compiled_with(change[0], change[1])
    with tempfile.TemporaryDirectory() as own:
        if anew:
            left_out = shutil.ignore_patterns(*(f"{stem}.*" for stem in anew))
            shutil.copytree(kept, own, dirs_exist_ok=True, ignore=left_out)
        cache = own if anew else kept
        env = {**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "NUMBA_CACHE_DIR": cache}
        done = subprocess.run(words, capture_output=True, text=True, env=env)
    return list(json.loads(done.stdout)) if done.returncode == 0 else [np.nan] * 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--modules", nargs="+", default=["angles", "sides"])
    parser.add_argument("--points", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--change", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.change:
        change = json.loads(args.change)
        if change is not None:
            module, constant, value = change
            value = tuple(value) if isinstance(value, list) else value
            sys.meta_path.insert(0, Finder(module, constant, value))  # type: ignore[arg-type]
        print(json.dumps(measured(args.points)))
        return
    found = {key: value for folder in args.modules for key, value in constants(folder).items()}
    with tempfile.TemporaryDirectory() as kept:
        report(found, args.points, args.workers, kept)


def report(found: dict[tuple[str, str], object], points: int, workers: int, kept: str) -> None:
    """Print the table; compiled code is kept in a folder."""
    import truth

    base = run(points, None, kept)
    print(f"As it is: {base[0]:.2f} % wrong, {base[1]:.2f} degrees, {base[2]:.2f} % dropped.\n", flush=True)
    jobs = [(*key, changed(value, factor)) for (key, value), factor in itertools.product(found.items(), (0.5, 2.0))]
    with ThreadPoolExecutor(workers) as threads:
        outcomes = list(threads.map(lambda job: run(points, job, kept), jobs))
    rows, calm = [], []
    for (key, value), half, double in zip(found.items(), outcomes[::2], outcomes[1::2], strict=True):
        name = f"{key[0].removeprefix('face_plugin.')}.{key[1]}"
        shifts = [np.subtract(outcome, base) for outcome in (half, double)]
        if all((np.abs(shift) < NOISE).all() for shift in shifts):
            calm.append(f"{name} = {value}")
            continue
        told = [f"{x:+.2f}" if np.isfinite(x) else "fails" for shift in shifts for x in shift]
        rows.append([name, str(value), *told])
    head = ["constant", "value", *(f"{a}, {b}" for a in ("half", "double") for b in ("wrong", "angle", "dropped"))]
    print(truth.table(head, rows))
    print(f"\nChange nothing that another seed would not: {', '.join(calm)}.")


if __name__ == "__main__":
    main()
