"""Cuts that better given sides, held against trying all."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from face_plugin.sides.clusters import cluster_signs
from face_plugin.sides.cuts import cut_signs
from face_plugin.sides.graph import Edges

Array = NDArray[np.float64]


def random_graph(seed: int) -> tuple[Edges, Array, Array]:
    """Make the edges of at most ten points, couplings of either sign, and evidence (n,)."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 11))
    pairs = np.argwhere(np.triu(rng.random((count, count)) < 0.5, 1))
    return Edges(pairs[:, 0], pairs[:, 1]), rng.normal(size=len(pairs)), rng.normal(size=count)


def worth(sign: Array, edges: Edges, coupling: Array, evidence: Array) -> float:
    return float(evidence @ sign + coupling @ (sign[edges.first] * sign[edges.second]))


@pytest.mark.parametrize("seed", range(40))
def test_where_no_edge_speaks_against_the_sides_the_cut_is_the_best_of_all(seed):
    edges, coupling, evidence = random_graph(seed)
    sign = np.sign(np.random.default_rng(seed).normal(size=len(evidence)))
    coupling = np.abs(coupling) * sign[edges.first] * sign[edges.second]
    found = worth(cut_signs(sign, edges, coupling, evidence), edges, coupling, evidence)
    best = max(worth(np.array(one), edges, coupling, evidence) for one in product((-1.0, 1.0), repeat=len(evidence)))
    # Capacities are rounded to a thousandth.
    assert found >= best - 0.001 * (len(coupling) + len(evidence))


@pytest.mark.parametrize("seed", range(40))
def test_it_is_never_worse(seed):
    edges, coupling, evidence = random_graph(seed)
    sign = cluster_signs(len(evidence), edges, coupling, evidence)
    after = worth(cut_signs(sign, edges, coupling, evidence), edges, coupling, evidence)
    assert after >= worth(sign, edges, coupling, evidence) - 1e-9


def test_a_part_that_was_joined_too_soon_is_turned_as_a_whole():
    """Joined by its strongest edge first; all that is known of its points, added up, says the opposite."""
    chain = Edges(np.arange(9), np.arange(1, 10))
    coupling, evidence = np.ones(9), np.where(np.arange(10) < 5, 0.5, -0.5)
    # Where nothing is known of a point, it goes with its neighbours.
    evidence[7] = 0.1
    assert np.array_equal(cut_signs(np.ones(10), chain, coupling, evidence), np.where(np.arange(10) < 5, 1.0, -1.0))


def test_huge_evidence_has_room():
    edges = Edges(np.array([0]), np.array([1]))
    evidence = np.array([1e12, -1e12])
    assert np.array_equal(cut_signs(np.ones(2), edges, np.ones(1), evidence), [1.0, -1.0])
