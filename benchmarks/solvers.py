"""Factorisation and solution of the Poisson system by each sparse solver that is installed, in one run.

    python benchmarks/solvers.py [--points N ...]

Seconds, the least of three, for three right-hand sides; the matrix is that of the demo's cloud.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_matrix

from face_plugin import FaCE, shapes
from face_plugin.faraday.poisson import factorise


def by_rslab(matrix: csc_matrix, right: np.ndarray) -> np.ndarray:
    """Solve by rslab's factorisation of symmetric matrices."""
    import rslab

    factor = rslab.ldlt(matrix)
    return np.stack([factor.solve(np.ascontiguousarray(column)) for column in right.T], axis=1)


SOLVERS: dict[str, tuple[str, Callable[[csc_matrix, np.ndarray], np.ndarray]]] = {
    "SuperLU": ("scipy", lambda matrix, right: factorise(matrix, "superlu")(right)),
    "CHOLMOD": ("sksparse", lambda matrix, right: factorise(matrix, "cholmod")(right)),
    "rslab": ("rslab", by_rslab),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[5000, 20_000, 60_000])
    args = parser.parse_args()
    installed = {name: solve for name, (module, solve) in SOLVERS.items() if importlib.util.find_spec(module)}
    print("points, unknowns: " + ", ".join(installed))
    for points in args.points:
        matrix = FaCE(shapes.demo_shape(points, 0).points).poisson.matrix
        right = np.random.default_rng(0).random((matrix.shape[0], 3))
        taken = []
        for solve in installed.values():
            runs = []
            for _ in range(3):
                start = time.perf_counter()
                solved = solve(matrix, right)
                runs.append(time.perf_counter() - start)
            assert np.allclose(matrix @ solved, right, atol=1e-8)
            taken.append(f"{min(runs):.3f} s")
        print(f"{points:,}, {matrix.shape[0]:,}: " + ", ".join(taken))


if __name__ == "__main__":
    main()
