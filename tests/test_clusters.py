"""Greedy contraction of signed graphs, held against the same done slowly."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from face_plugin.sides.clusters import better_signs, cluster_signs
from face_plugin.sides.contraction import AT_ONCE
from face_plugin.sides.graph import Edges

Array = NDArray[np.float64]


def slowly_contracted(count: int, edges: Edges, coupling: Array) -> Array:
    """Signs (count,), by looking at all edges for the heaviest, joining the ends of such ones, and starting over."""
    weight = {
        (int(min(a, b)), int(max(a, b))): float(w) for a, b, w in zip(edges.first, edges.second, coupling, strict=True)
    }
    cluster, sign = np.arange(count), np.ones(count)
    while weight and max(map(abs, weight.values())) > 0:
        least = AT_ONCE * max(map(abs, weight.values()))
        batch = sorted((pair for pair in weight if abs(weight[pair]) >= least), key=lambda pair: -abs(weight[pair]))
        # Named by points, as clusters change their names within a round.
        for a, b, side in [(a, b, np.sign(weight[a, b])) for a, b in batch]:
            side, a, b = side * sign[a] * sign[b], cluster[a], cluster[b]
            if a == b:
                continue
            members = cluster == a
            cluster[members], sign[members] = b, sign[members] * side
            for pair in [pair for pair in weight if a in pair]:
                other = pair[0] + pair[1] - a
                moved, value = (min(b, other), max(b, other)), weight.pop(pair)
                if other != b:
                    weight[moved] = weight.get(moved, 0.0) + side * value
    return sign


def random_graph(seed: int) -> tuple[int, Edges, Array]:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 40))
    pairs = np.argwhere(np.triu(rng.random((count, count)) < 0.3, 1))
    return count, Edges(pairs[:, 0], pairs[:, 1]), rng.normal(size=len(pairs))


@pytest.mark.parametrize("seed", range(100))
def test_signs_with_evidence_are_those_of_the_slow_way(seed):
    count, edges, coupling = random_graph(seed)
    evidence = 0.3 * np.random.default_rng(seed).normal(size=count)
    everyone = np.arange(count)
    with_space = Edges(np.concatenate([edges.first, everyone]), np.concatenate([edges.second, np.full(count, count)]))
    sign = slowly_contracted(count + 1, with_space, np.concatenate([coupling, evidence]))
    assert np.array_equal(cluster_signs(count, edges, coupling, evidence), (sign * sign[count])[:count])


@pytest.mark.parametrize("seed", range(100))
def test_without_evidence_each_component_is_as_of_the_slow_way_and_keeps_most_of_its_lines(seed):
    count, edges, coupling = random_graph(seed)
    found, expected = cluster_signs(count, edges, coupling), slowly_contracted(count, edges, coupling)
    joined = coo_matrix((np.ones(len(coupling)), (edges.first, edges.second)), shape=(count, count))
    components, label = connected_components(joined, directed=False)
    for component in range(components):
        members = label == component
        assert abs((found * expected)[members].sum()) == members.sum()
        assert found[members].sum() >= 0


def test_many_points_with_one_cut_come_out_on_two_sides():
    # A grid of 120 by 120 points whose true signs are drawn at random a quadrant: every coupling tells them truly.
    size = 120
    index = np.arange(size * size).reshape(size, size)
    right, down = (index[:, :-1].ravel(), index[:, 1:].ravel()), (index[:-1].ravel(), index[1:].ravel())
    edges = Edges(np.concatenate([right[0], down[0]]), np.concatenate([right[1], down[1]]))
    row, column = np.divmod(np.arange(size * size), size)
    true = np.where((row < 40) ^ (column < 70), -1.0, 1.0)
    strength = np.random.default_rng(0).uniform(0.1, 1.0, len(edges.first))
    evidence = np.zeros(size * size)
    evidence[0] = -0.01 * true[0]
    found = cluster_signs(size * size, edges, strength * true[edges.first] * true[edges.second], evidence)
    assert np.array_equal(found, -true)


def test_better_signs_are_never_worse_than_leaving_all_lines_as_they_are():
    def fit(edges: Edges, coupling: Array, evidence: Array, sign: Array) -> float:
        return float(evidence @ sign + coupling @ (sign[edges.first] * sign[edges.second]))

    for seed in range(100):
        count, edges, coupling = random_graph(seed)
        evidence = np.random.default_rng(seed).normal(size=count)
        found = better_signs(count, edges, coupling, evidence)
        assert fit(edges, coupling, evidence, found) >= fit(edges, coupling, evidence, np.ones(count)) - 1e-9
    # One edge lies, and is the heaviest: what its ends have in common with three others cancels once they are joined.
    edges = Edges(np.array([0, 0, 0, 0, 1, 1, 1]), np.array([1, 2, 3, 4, 2, 3, 4]))
    coupling, evidence = np.array([-1.0, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9]), np.full(5, 0.1)
    assert cluster_signs(5, edges, coupling, evidence).sum() == 3
    assert np.array_equal(better_signs(5, edges, coupling, evidence), np.ones(5))
