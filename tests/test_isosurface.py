from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from tet_meshes import cage_mesh, enclosed_volume, grid_mesh, open_edges, tet_volumes, triangle_normals

from face_plugin.faraday.isosurface import fill_balls, isosurface
from face_plugin.faraday.meshers import CageMesh

TURN = Rotation.from_euler("xyz", [0.3, 0.5, 0.7])


def volume_below(corners: NDArray[np.float64], values: NDArray[np.float64], level: float) -> float:
    """Volume of the part of a tetrahedron where the linear field is below `level`."""
    share = 0.0
    for i in np.flatnonzero(values < level):
        share += (level - values[i]) ** 3 / np.prod(np.delete(values, i) - values[i])
    return share * float(tet_volumes(corners, np.array([[0, 1, 2, 3]]))[0])


@pytest.mark.parametrize("case", range(16))
def test_every_sign_case(case: int) -> None:
    rng = np.random.default_rng(case)
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) + rng.uniform(-0.2, 0.2, (4, 3))
    above = (case >> np.arange(4)) & 1
    values = 2.0 + np.where(above, 1, -1) * rng.uniform(0.2, 1, 4)
    tet = np.array([[0, 1, 2, 3]])
    v, f = isosurface(corners, tet, values, 2.0, close=False)
    assert len(f) == [0, 1, 2, 1, 0][above.sum()]
    gradient = np.linalg.solve(corners[1:] - corners[0], values[1:] - values[0])
    assert (triangle_normals(v, f) @ gradient > 0).all()
    np.testing.assert_allclose((v - corners[0]) @ gradient + values[0], 2.0, atol=1e-12)

    v, f = isosurface(corners, tet, values, 2.0)
    assert open_edges(f) == 0
    assert len(f) == [4, 8, 8, 4, 0][above.sum()]
    assert enclosed_volume(v, f) == pytest.approx(volume_below(corners, values, 2.0), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("kind", ["noise", "equal to the level"])
@pytest.mark.parametrize("seed", range(3))
def test_closed_and_consistent_whatever_the_values(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices, tets = grid_mesh(7, TURN)
    values = rng.normal(size=len(vertices)) if kind == "noise" else rng.integers(-1, 2, len(vertices))
    v, f = isosurface(vertices, tets, values, 0.0)
    assert open_edges(f) == 0
    assert np.array_equal(np.unique(f), np.arange(len(v)))
    if kind == "noise":
        below = sum(volume_below(vertices[tet], values[tet], 0.0) for tet in tets)
        assert enclosed_volume(v, f) == pytest.approx(below, rel=1e-9)


def test_below_and_above_fill_the_mesh() -> None:
    vertices, tets = grid_mesh(6, TURN)
    values = np.random.default_rng(5).integers(-2, 3, len(vertices))
    low, high = isosurface(vertices, tets, values, 0.5), isosurface(vertices, tets, -values, -0.5)
    assert enclosed_volume(*low) + enclosed_volume(*high) == pytest.approx(8)


def test_a_value_equal_to_the_level_is_above() -> None:
    vertices, tets = grid_mesh(2)
    middle = len(vertices) // 2
    values = np.ones(len(vertices))
    values[middle] = 0
    assert len(isosurface(vertices, tets, values, 0.0)[1]) == 0
    v, f = isosurface(vertices, tets, -values, 0.0)
    # The region above is the middle vertex alone: a closed surface shrunk to a point, in that of the cube.
    assert open_edges(f) == 0
    collapsed = np.linalg.norm(triangle_normals(v, f), axis=1) == 0
    assert collapsed.sum() == (tets == middle).any(axis=1).sum()
    assert (v[f[collapsed]] == 0).all()
    assert enclosed_volume(v, f) == pytest.approx(8)


@pytest.mark.parametrize("centre", [(0.1, 0.0, -0.05), (-1.0, -1.0, -1.0)])
def test_volume_of_a_ball_converges_quadratically(centre: tuple[float, float, float]) -> None:
    # About the corner of the cube an eighth of the ball is left, closed along three sides of the cube.
    exact = 4 / 3 * np.pi * 0.8**3 * (1 if centre[0] > -1 else 1 / 8)
    error = []
    for n in (8, 16, 32):
        vertices, tets = grid_mesh(n)
        v, f = isosurface(vertices, tets, ((vertices - centre) ** 2).sum(axis=1), 0.8**2)
        assert open_edges(f) == 0
        error.append(abs(enclosed_volume(v, f) / exact - 1))
    order = np.log2(np.array(error[:-1]) / error[1:])
    # Linear interpolation is of second order: 1.94 to 2.01 were measured.
    assert (order > 1.8).all()
    assert (order < 2.2).all()
    assert error[-1] < 0.01


def test_surface_that_is_cut_by_the_box_runs_along_it() -> None:
    vertices, tets = grid_mesh(6)
    values = vertices @ [0.3, 0.2, 1.0]
    v, f = isosurface(vertices, tets, values, 0.13)
    loose_v, loose_f = isosurface(vertices, tets, values, 0.13, close=False)
    assert open_edges(f) == 0
    assert len(loose_f) > 0
    np.testing.assert_allclose(loose_v @ [0.3, 0.2, 1.0], 0.13, atol=1e-12)
    edges = np.sort(np.concatenate([loose_f[:, [0, 1]], loose_f[:, [1, 2]], loose_f[:, [2, 0]]]), axis=1)
    rim, count = np.unique(edges, axis=0, return_counts=True)
    assert (np.abs(loose_v[rim[count == 1]]).max(axis=2) == 1).all()
    cap = f[len(loose_f) :]
    corners, normals = v[cap], triangle_normals(v, cap)
    side = np.abs(normals).argmax(axis=1)
    outwards = np.sign(np.take_along_axis(normals, side[:, None], axis=1))
    assert (np.take_along_axis(corners, side[:, None, None], axis=2)[..., 0] == outwards).all()
    assert enclosed_volume(v, f) == pytest.approx(4.52)  # half of the cube and a layer of 0.13


def test_mesh_wholly_on_one_side() -> None:
    vertices, tets = grid_mesh(3)
    v, f = isosurface(vertices, tets, np.zeros(len(vertices)), 1.0)
    assert len(f) == 12 * 3**2
    assert open_edges(f) == 0
    assert enclosed_volume(v, f) == pytest.approx(8)
    for level, close in ((0.0, True), (1.0, False)):
        v, f = isosurface(vertices, tets, np.zeros(len(vertices)), level, close=close)
        assert (v.shape, f.shape) == ((0, 3), (0, 3))
        assert (v.dtype, f.dtype) == (np.float64, np.int64)


def test_mesh_with_holes_is_closed_around_them() -> None:
    rng = np.random.default_rng(2)
    mesh = cage_mesh(rng.normal(size=(30, 3)), rng, free=300)
    v, f = isosurface(mesh.vertices, mesh.tets, np.zeros(len(mesh.vertices)), 1.0)
    assert open_edges(f) == 0
    assert len(f) == (2 * 400 - 4) + 30 * 8  # the sphere of 400 vertices and 30 octahedra
    assert enclosed_volume(v, f) == pytest.approx(tet_volumes(mesh.vertices, mesh.tets).sum())


@pytest.mark.parametrize("seed", range(3))
def test_filled_balls(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(200, 3))
    points[100:] /= np.linalg.norm(points[100:], axis=1, keepdims=True)
    mesh = cage_mesh(points, rng, free=500)
    slope = np.array([1.0, -2.0, 0.5])
    vertices, tets, values = fill_balls(mesh, mesh.vertices @ slope)
    assert np.array_equal(vertices[: len(mesh.vertices)], mesh.vertices)
    assert np.array_equal(tets[: len(mesh.tets)], mesh.tets)
    np.testing.assert_allclose(vertices[len(mesh.vertices) :], points, atol=1e-12)
    np.testing.assert_allclose(values, vertices @ slope, atol=1e-12)
    assert len(tets) - len(mesh.tets) == 8 * len(points)
    volume = tet_volumes(vertices, tets)
    assert volume.min() > 0
    assert volume.sum() == pytest.approx(ConvexHull(vertices).volume, rel=1e-12)
    _, f = isosurface(vertices, tets, rng.normal(size=len(vertices)), 0.0)
    assert open_edges(f) == 0


def test_balls_need_not_be_numbered_without_gaps() -> None:
    rng = np.random.default_rng(3)
    mesh = cage_mesh(rng.normal(size=(20, 3)), rng, free=100)
    values = rng.normal(size=len(mesh.vertices))
    gaps = replace(mesh, owner=np.where(mesh.owner < 0, -1, 3 * mesh.owner + 5).astype(np.int32))
    for plain, other in zip(fill_balls(mesh, values), fill_balls(gaps, values), strict=True):
        assert np.array_equal(plain, other)


def test_face_between_two_tetrahedra_is_no_facet() -> None:
    vertices, tets = grid_mesh(1)
    pair = next(p for p in combinations(tets, 2) if len(np.intersect1d(*p)) == 3)
    owner = np.full(len(vertices), -1, dtype=np.int32)
    owner[np.intersect1d(*pair)] = 0
    box = np.zeros(len(vertices), dtype=bool), vertices.min(axis=0), vertices.max(axis=0)
    both = CageMesh(vertices, np.array(pair), owner, *box)
    one = CageMesh(vertices, np.array(pair[:1]), owner, *box)
    assert len(fill_balls(both, np.zeros(len(vertices)))[1]) == 2
    assert len(fill_balls(one, np.zeros(len(vertices)))[1]) == 1 + 1


def test_bad_arguments_are_named() -> None:
    vertices, tets = grid_mesh(1)
    values = np.zeros(len(vertices))
    bad_value, bad_vertex = values.copy(), vertices.copy()
    bad_value[0], bad_vertex[0, 0] = np.nan, np.inf
    for name, arguments in {
        "vertices: .*shape": (vertices[:, :2], tets, values, 0.5),
        "vertices: finite": (bad_vertex, tets, values, 0.5),
        "tets: integers": (vertices, tets.astype(float), values, 0.5),
        "tets: .*shape": (vertices, tets[:, :3], values, 0.5),
        "tets: indices from 0 to 7 .* 1 to 8": (vertices, tets + 1, values, 0.5),
        "tets: indices .* -1 to 6": (vertices, tets - 1, values, 0.5),
        r"values: shape \(8,\)": (vertices, tets, values[1:], 0.5),
        "values: finite": (vertices, tets, bad_value, 0.5),
        "level: finite": (vertices, tets, values, np.nan),
    }.items():
        with pytest.raises(ValueError, match=name):
            isosurface(*arguments)
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="values: shape"):
        fill_balls(cage_mesh(rng.normal(size=(5, 3)), rng, free=50), np.zeros(3))
