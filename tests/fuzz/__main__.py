"""Random cases of every kind, in processes of their own under a watchdog: python tests/fuzz --cases 1000 --seed 0.

A case is a function ``case(seed, folder) -> str`` of a module of this folder, which may have a ``prepare()`` for what
takes its time only once, such as compiling. It returns what became of it in a few words that may be counted, or raises
where that is no outcome that anybody was promised.
"""

from __future__ import annotations

import argparse
import importlib
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from pathlib import Path

HERE = Path(__file__).parent
# Share of the cases: a fault takes seconds, a damaged file milliseconds.
KINDS = {"clouds": 0.45, "files": 0.45, "steps": 0.05, "packed": 0.02, "faults": 0.02, "threads": 0.005, "lost": 0.005}
Found = queue.Queue[tuple[str, int, str]]
HANG = 60.0
"""Seconds without an answer after which a case counts as hanging."""


def child(kind: str, first: int, count: int, step: int) -> None:
    """Run cases and say of each what became of it; the parent knows from the silence which one ended the process."""
    sys.path[:0] = [str(HERE), str(HERE.parent)]
    answer = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    module = importlib.import_module(kind)
    if hasattr(module, "prepare"):
        module.prepare()
    answer.write("ready\n")
    for seed in range(first, first + count, step):
        with tempfile.TemporaryDirectory(prefix="face-fuzz-") as folder:
            try:
                outcome = module.case(seed, Path(folder))
            except Exception as error:
                where = traceback.extract_tb(error.__traceback__)[-1]
                said = " ".join(str(error).split())[:200]
                outcome = f"FAILED {type(error).__name__} at {Path(where.filename).name}:{where.lineno}: {said}"
        answer.write(f"{seed} {outcome}\n")


def watched(kind: str, first: int, last: int, step: int, until: float, place: str, found: Found) -> None:
    """Run cases in children, a new one after each that crashes or hangs."""
    seed = first
    while seed < last and time.monotonic() < until:
        words = [sys.executable, str(HERE), "--child", kind, str(seed), str(last - seed), str(step)]
        lines: queue.Queue[str] = queue.Queue()
        options = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "env": {**os.environ, "TMPDIR": place}}
        with subprocess.Popen(words, text=True, **options) as process:

            def read(stream=process.stdout, lines=lines) -> None:
                for line in stream:
                    lines.put(line)
                lines.put("")

            threading.Thread(target=read, daemon=True).start()
            if not lines.get():
                lines.put("")  # it ended before it was ready
            while seed < last:
                try:
                    line = lines.get(timeout=HANG)
                except queue.Empty:
                    process.kill()
                    line = f"{seed} FAILED hangs"
                if not line:
                    line = f"{seed} FAILED ends the process with code {process.wait()}"
                found.put((kind, seed, line.partition(" ")[2].strip()))
                seed += step
                if "FAILED hangs" in line or "FAILED ends" in line or time.monotonic() > until:
                    break
            if time.monotonic() > until:
                # The case that it is at tidies up.
                process.send_signal(signal.SIGINT)


def main() -> int:
    """Run the cases, count what became of them, and return 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="of the first case; the others follow")
    parser.add_argument("--kind", choices=KINDS, help="only these cases")
    parser.add_argument("--seconds", type=float, default=1e9, help="begin no more cases after so many")
    parser.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        child(args.child[0], *map(int, args.child[1:]))
        return 0
    found: Found = queue.Queue()
    # What children that are killed leave behind goes with it.
    place = tempfile.TemporaryDirectory(prefix="face-fuzz-", ignore_cleanup_errors=True)
    shares = {args.kind: 1.0} if args.kind else KINDS
    workers, start, counts = os.cpu_count() or 1, time.monotonic(), Counter[tuple[str, str]]()
    for kind, share in shares.items():
        until = time.monotonic() + args.seconds * share
        last = args.seed + max(1, round(args.cases * share))
        threads = [
            threading.Thread(target=watched, args=(kind, args.seed + k, last, workers, until, place.name, found))
            for k in range(min(workers, last - args.seed))
        ]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads) or not found.empty():
            try:
                _, seed, outcome = found.get(timeout=0.2)
            except queue.Empty:
                continue
            counts[kind, outcome.partition(":")[0]] += 1
            if outcome.startswith("FAILED"):
                sys.stdout.write(f"{kind} {seed} {outcome}\n")
                sys.stdout.flush()
    for (kind, outcome), number in sorted(counts.items()):
        sys.stdout.write(f"{number:7} {kind:8} {outcome}\n")
    place.cleanup()
    failed = sum(number for (_, outcome), number in counts.items() if outcome.startswith("FAILED"))
    sys.stdout.write(f"{sum(counts.values()):7} cases, {failed} failed, {time.monotonic() - start:.0f} s\n")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
