"""The flood outside of an alpha shape, held against its definition, facet by facet."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial import Delaunay

from face_plugin import shapes
from face_plugin.sides.alpha_shape import AlphaShapes


def sphere_around(corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of the least sphere that passes through all of three or four points."""
    edges = corners[1:] - corners[0]
    offset = np.linalg.lstsq(2 * edges, (edges**2).sum(axis=1), rcond=None)[0]
    return corners[0] + offset, float(np.linalg.norm(offset))


def slowly(points: np.ndarray, mesh: Delaunay, radius: float) -> np.ndarray:
    """Walk from tetrahedron to tetrahedron through every facet that no ball of so small a radius holds alone."""
    around = [sphere_around(points[tet])[1] for tet in mesh.simplices]

    def passes(tet: int, k: int) -> bool:
        facet = np.delete(mesh.simplices[tet], k)
        centre, least = sphere_around(points[facet])
        rest = np.delete(points, facet, axis=0)
        if (np.linalg.norm(rest - centre, axis=1) >= least).all():
            return least > radius
        beyond = mesh.neighbors[tet, k]
        return min(around[tet], np.inf if beyond < 0 else around[beyond]) > radius

    reached = np.zeros(len(mesh.simplices), dtype=bool)
    front = [
        tet
        for tet, k in itertools.product(range(len(reached)), range(4))
        if mesh.neighbors[tet, k] < 0 and passes(tet, k)
    ]
    while front:
        tet = front.pop()
        if not reached[tet]:
            reached[tet] = True
            front += [mesh.neighbors[tet, k] for k in range(4) if mesh.neighbors[tet, k] >= 0 and passes(tet, k)]
    return reached


@pytest.mark.parametrize("radius", [0.1, 0.2, 0.3, 0.5])
def test_the_flood_is_that_of_the_definition(radius):
    points = np.random.default_rng(0).uniform(size=(80, 3))
    mesh = Delaunay(points)
    expected = slowly(points, mesh, radius)
    assert np.array_equal(AlphaShapes(points, mesh.simplices).outside(np.full(80, radius)), expected)
    # At most radii a part is reached.
    assert expected.any()


@pytest.mark.parametrize(("radius", "inside"), [(0.15, True), (0.5, True), (0.7, False)])
def test_a_ball_gets_into_a_hollow_through_a_hole_that_is_wider(radius, inside):
    # Spacing 0.09, and a hole of radius 0.6.
    points = shapes.sphere(1500, 0).points
    points = points[points[:, 2] < 0.8]
    mesh = Delaunay(points)
    middle = int(mesh.find_simplex(np.array([[0.01, 0.02, -0.03]]))[0])
    assert AlphaShapes(points, mesh.simplices).outside(np.full(len(points), radius))[middle] == inside
