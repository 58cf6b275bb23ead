#!/usr/bin/env python3
"""Angles of normals on what scanners leave, against a plane of 30 neighbours: one table, on generated clouds.

    python benchmarks/angles.py [--points 6000] [--seed 0]

The sides are given, some fifteen degrees off: only the angles are found. Angles are of lines, in degrees. `edge` is the
mean over points with another face, more than 15 degrees off, among their 12 nearest.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin import shapes
from face_plugin.angles import turning
from face_plugin.geometry import plane_fit, unit
from face_plugin.neighbourhood import Neighbourhood

Array = NDArray[np.float64]
Sample = tuple[Array, Array]


def roof(n: int, rng: np.random.Generator, sigma: float, steep: float = 1.0) -> Sample:
    """Two planes that meet at x = 0, with noise of `sigma` spacings across them."""
    x, y = rng.uniform(-1, 1, (2, n))
    normals = unit(np.stack([steep * np.sign(x), 0 * x, 1 + 0 * x], axis=1))
    height = sigma * np.sqrt(4 / n) * rng.normal(size=(n, 1))
    return np.stack([x, y, -steep * np.abs(x)], axis=1) + height * normals, normals


def waves(n: int, rng: np.random.Generator, sigma: float) -> Sample:
    """Sample a surface that bends in all directions."""
    x, y = rng.uniform(-1, 1, (2, n))
    z = 0.1 * np.sin(6 * x) * np.cos(5 * y)
    slope = [0.6 * np.cos(6 * x) * np.cos(5 * y), -0.5 * np.sin(6 * x) * np.sin(5 * y)]
    normals = unit(np.stack([-slope[0], -slope[1], 1 + 0 * x], axis=1))
    return np.stack([x, y, z], axis=1) + sigma * np.sqrt(4 / n) * rng.normal(size=(n, 1)) * normals, normals


def rows(n: int, rng: np.random.Generator, apart: int) -> Sample:
    """Sample a torus in scan lines, `apart` times as far from one another as points along them."""
    lines = max(6, int(np.sqrt(n / (2 * apart))))
    u, v = (
        a.ravel()
        for a in np.meshgrid(
            np.linspace(0, 2 * np.pi, 2 * apart * lines, endpoint=False) + rng.uniform(0, 6),
            np.linspace(0, 2 * np.pi, lines, endpoint=False) + rng.uniform(0, 6),
            indexing="ij",
        )
    )
    normals = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=1)
    return np.stack([np.cos(u), np.sin(u), 0 * u], axis=1) + 0.35 * normals, normals


def rings(n: int, rng: np.random.Generator, sigma: float) -> Sample:
    """Ground seen by a spinning sensor: rings that grow apart."""
    count = 16
    turn, ring = np.meshgrid(np.linspace(0, 2 * np.pi, n // count, endpoint=False), 1.18 ** np.arange(count))
    turn, reach = turn.ravel(), ring.ravel() * (1 + 0.002 * rng.normal(size=ring.size))
    ground = np.stack([reach * np.cos(turn), reach * np.sin(turn), sigma * rng.normal(size=reach.size)], axis=1)
    return ground, np.tile([0.0, 0.0, 1.0], (len(ground), 1))


def lattice(n: int, rng: np.random.Generator, layers: float) -> Sample:
    """Sample a slope whose coordinates are rounded, with noise of so many steps across it."""
    step = np.sqrt(1.0 / n)
    x, y = rng.uniform(0, 1, (2, n))
    points = np.stack([x, y, 0.2 * x - 0.1 * y + layers * step * rng.normal(size=n)], axis=1)
    points = np.unique(np.round(points / step) * step, axis=0)
    return points, np.tile(unit(np.array([[-0.2, 0.1, 1.0]])), (len(points), 1))


def room(n: int, rng: np.random.Generator, sigma: float) -> Sample:
    """Scan a box from a point inside it: the density falls with the square of the distance."""
    way = unit(rng.normal(size=(n, 3)))
    at, low, high = np.array([1.0, 0.7, 0.8]), np.zeros(3), np.array([4.0, 3.0, 2.0])
    with np.errstate(divide="ignore"):
        hit = np.where(way > 0, (high - at) / way, (low - at) / way)
    wall = hit.argmin(axis=1)
    normals = np.zeros((n, 3))
    normals[np.arange(n), wall] = -np.sign(way[np.arange(n), wall])
    return at + way * (hit.min(axis=1) + sigma * rng.normal(size=n))[:, None], normals


def shape(make: Callable[[int, int], shapes.Shape], sigma: float = 0.0) -> Callable[[int, np.random.Generator], Sample]:
    """One of the package's shapes, with noise."""

    def sample(n: int, rng: np.random.Generator) -> Sample:
        made = make(n, int(rng.integers(1 << 30)))
        if sigma:
            made = shapes.with_noise(made, sigma, 0)
        return made.points, made.normals

    return sample


CLOUDS: dict[str, Callable[[int, np.random.Generator], Sample]] = {
    "roof, no noise": lambda n, rng: roof(n, rng, 0.0),
    "roof, noise 0.1 spacings": lambda n, rng: roof(n, rng, 0.1),
    "roof, noise 0.5 spacings": lambda n, rng: roof(n, rng, 0.5),
    "shallow roof, noise 0.1 spacings": lambda n, rng: roof(n, rng, 0.1, steep=0.3),
    "waves, no noise": lambda n, rng: waves(n, rng, 0.0),
    "waves, noise 0.2 spacings": lambda n, rng: waves(n, rng, 0.2),
    "lines 4 apart": lambda n, rng: rows(n, rng, 4),
    "lines 10 apart": lambda n, rng: rows(n, rng, 10),
    "rings": lambda n, rng: rings(n, rng, 0.005),
    "lattice, one layer": lambda n, rng: lattice(n, rng, 0.0),
    "lattice, several layers": lambda n, rng: lattice(n, rng, 1.0),
    "room, millimetre noise": lambda n, rng: room(n, rng, 0.002),
    "sphere": shape(shapes.sphere),
    "box": shape(shapes.box),
    "crossed cylinders": shape(shapes.crossed_cylinders),
    "teapot": shape(shapes.teapot),
    "teapot, noise": shape(shapes.teapot, 0.004),
}


def off(normals: Array, truth: Array) -> Array:
    """Angles (n,) between lines, in degrees."""
    return np.asarray(np.degrees(np.arccos(np.clip(np.abs((normals * truth).sum(axis=1)), 0, 1))))


def near_edges(points: Array, truth: Array) -> NDArray[np.bool_]:
    """Points (n,) with another face, more than 15 degrees off, among their 12 nearest."""
    near = truth[cKDTree(points).query(points, k=13)[1]]
    return np.asarray(((near * truth[:, None]).sum(axis=2) < np.cos(np.radians(15))).any(axis=1))


def measure(points: Array, truth: Array, rng: np.random.Generator) -> tuple[float, float, float]:
    """Mean angle, that near edges, and seconds."""
    rough = unit(truth + 0.2 * rng.normal(size=truth.shape))
    around, nobody = Neighbourhood(points), np.zeros(len(points), dtype=bool)
    _ = around.neighbour, around.tree
    start = time.perf_counter()
    found = off(turning.turn_angles(around, rough, nobody, nobody).normals, truth)
    seconds = time.perf_counter() - start
    edge = near_edges(points, truth)
    return float(found.mean()), float(found[edge].mean()) if edge.any() else np.nan, seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=6000)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    print(f"{'cloud':34s}{'plane of 30':>12s}{'edge':>7s}{'here':>8s}{'edge':>7s}{'seconds':>9s}")
    for name, make in CLOUDS.items():
        rng = np.random.default_rng(args.seed)
        points, truth = make(args.points, rng)
        plane = off(plane_fit(points, *cKDTree(points).query(points, k=31), count=30, width=10.0), truth)
        edge = near_edges(points, truth)
        mean, sharp, seconds = measure(points, truth, rng)
        at_edge = plane[edge].mean() if edge.any() else np.nan
        print(f"{name:34s}{plane.mean():12.2f}{at_edge:7.2f}{mean:8.2f}{sharp:7.2f}{seconds:9.2f}")


if __name__ == "__main__":
    main()
