from __future__ import annotations

import itertools
import logging
import sys
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tet_meshes import cage_mesh, grid_mesh

from face_plugin.faraday import inside as module
from face_plugin.faraday.inside import inside, inside_by_rays, inside_by_winding
from face_plugin.faraday.isosurface import fill_balls, isosurface

Points = NDArray[np.float64]
Triangles = NDArray[np.int64]
METHODS = ("rays", "winding")
N = 6
TURN = Rotation.from_euler("xyz", [0.3, 0.5, 0.7])


def cells(keep: Callable[[Points], NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Solid made of cells of a grid of N^3 over [-1, 1]^3: those whose centre is kept."""
    axis = (np.arange(N) + 0.5) * 2 / N - 1
    return keep(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1))


SOLIDS = {
    "cube": cells(lambda p: np.ones(p.shape[:3], dtype=bool)),
    "cavity": cells(lambda p: np.abs(p).max(axis=-1) > 0.4),
    "ring": cells(lambda p: np.abs(p[..., :2]).max(axis=-1) > 0.4),
    "two plates": cells(lambda p: np.abs(p[..., 0]) > 0.6),
    "ball in a shell": cells(lambda p: (np.abs(p).max(axis=-1) > 0.7) | (np.abs(p).max(axis=-1) < 0.3)),
}


def surface(solid: NDArray[np.bool_]) -> tuple[Points, Triangles]:
    vertices, tets = grid_mesh(N)
    inner = tets[np.tile(solid.ravel(), 6)]
    return isosurface(vertices, inner, np.zeros(len(vertices)), 1.0)


def truth(solid: NDArray[np.bool_], points: Points) -> NDArray[np.bool_]:
    index = np.floor((points + 1) * N / 2).astype(int)
    within = ((index >= 0) & (index < N)).all(axis=1)
    return within & solid[tuple(np.clip(index, 0, N - 1).T)]


def away(solid: NDArray[np.bool_], points: Points) -> NDArray[np.bool_]:
    """Whether a point is over 1e-4 of the diagonal away from the surface: a cube around it is on one side."""
    reach = 1e-4 * np.sqrt(12)
    around = [truth(solid, points + reach * np.array(c)) for c in itertools.product((-1, 1), repeat=3)]
    return np.all(around, axis=0) | ~np.any(around, axis=0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", SOLIDS)
def test_exact_on_solids(name: str, turned: bool, method: str) -> None:
    solid = SOLIDS[name]
    v, f = surface(solid)
    points = np.random.default_rng(1).uniform(-1.1, 1.1, (20000, 3))
    points[:4000] = np.round(points[:4000] * 2 * N) / (2 * N)  # on the planes, lines and corners of the grid
    points = points[away(solid, points)]
    assert len(points) > 15000
    expected = truth(solid, points)
    assert expected.any()
    assert not expected.all()
    turn = TURN if turned else Rotation.identity()
    assert np.array_equal(inside(turn.apply(points), turn.apply(v), f, method), expected)


def test_methods_agree_on_an_isosurface() -> None:
    rng = np.random.default_rng(0)
    vertices, tets = grid_mesh(20, TURN)
    waves = rng.normal(size=(3, 12)) * 3
    values = np.cos(vertices @ waves + rng.uniform(0, 2 * np.pi, 12)).sum(axis=1)
    v, f = isosurface(vertices, tets, values, -0.5)
    assert len(f) > 10000
    points = rng.uniform(-1, 1, (20000, 3))
    rays, winding = (inside(points, v, f, method) for method in METHODS)
    assert 0.2 < rays.mean() < 0.6
    # All 20,000 agreed with each of ten seeds.
    assert (rays == winding).mean() >= 0.9995


@pytest.mark.parametrize("method", METHODS)
def test_vertex_of_the_mesh_is_inside_where_its_value_is_below(method: str) -> None:
    # The roughest surface there is; values of -1 and 1 keep it half an edge away from every vertex.
    rng = np.random.default_rng(0)
    points = rng.normal(size=(150, 3))
    mesh = cage_mesh(points, rng, free=300)
    vertices, tets, _ = fill_balls(mesh, np.zeros(len(mesh.vertices)))
    values = rng.choice([-1.0, 1.0], len(vertices))
    values[np.flatnonzero(mesh.boundary)] = 1.0
    v, f = isosurface(vertices, tets, values, 0.0)
    assert np.array_equal(inside(vertices, v, f, method), values < 0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("scale", "shift"), [(1e-6, 0.0), (1e9, 0.0), (1.0, 1e6), (1e3, -1e9)])
def test_any_unit_and_place(method: str, scale: float, shift: float) -> None:
    solid = SOLIDS["ring"]
    v, f = surface(solid)
    points = np.random.default_rng(2).uniform(-1.1, 1.1, (2000, 3))
    points = points[away(solid, points)]
    moved = inside(points * scale + shift, v * scale + shift, f, method)
    assert np.array_equal(moved, truth(solid, points))


@pytest.mark.parametrize("method", METHODS)
def test_degenerate_triangles_have_no_effect(method: str) -> None:
    solid = SOLIDS["cavity"]
    v, f = surface(solid)
    points = np.random.default_rng(3).uniform(-1.1, 1.1, (2000, 3))
    points = points[away(solid, points)]
    v = np.concatenate([v, [[0.0, 0, 0], [1, 1, 1], [2, 2, 2], [1e6, 0, 0]]])
    k = len(v) - 4
    flat = np.array([[k, k + 1, k + 2], [k, k, k + 1], [k + 1, k + 1, k + 1], [0, 5, 5]])
    expected = truth(solid, points)
    assert np.array_equal(inside(points, v, np.concatenate([flat, f]), method), expected)
    assert not inside(points, v, flat, method).any()


@pytest.mark.parametrize("method", METHODS)
def test_points_on_the_surface_are_bounded_by_those_beside_it(method: str) -> None:
    v, f = surface(SOLIDS["cube"])
    on = np.concatenate([v[f].mean(axis=1), v, (v[f[:, 0]] + v[f[:, 1]]) / 2])
    first = inside(on, v, f, method)
    assert first.shape == (len(on),)
    assert np.array_equal(first, inside(on, v, f, method))
    # 1e-5 is five times the accuracy that the module states.
    assert inside(on * (1 - 1e-5), v, f, method).all()
    assert not inside(on * (1 + 1e-5), v, f, method).any()


@pytest.mark.parametrize("method", METHODS)
def test_nothing_to_enclose_and_nothing_to_classify(method: str) -> None:
    v, f = surface(SOLIDS["cube"])
    empty = np.zeros((0, 3))
    assert inside(empty, v, f, method).shape == (0,)
    assert not inside(v, empty, empty.astype(int), method).any()
    assert not inside(v, v, empty.astype(int), method).any()
    assert not inside([[5.0, 0, 0]], v, f, method).any()


def test_seed_decides_the_directions_only(monkeypatch: pytest.MonkeyPatch) -> None:
    solid = SOLIDS["ring"]
    v, f = surface(solid)
    points = np.random.default_rng(4).uniform(-1, 1, (1000, 3))
    points = points[away(solid, points)]
    expected = truth(solid, points)
    for directions, seed in ((1, 0), (3, 1), (12, 2), (50, 3)):
        assert np.array_equal(inside_by_rays(points, v, f, directions=directions, seed=seed), expected)
    monkeypatch.setattr(module, "_RAYS_AT_ONCE", 100)  # in several parts
    assert np.array_equal(inside_by_rays(points, v, f), expected)


def without_sides(*sides: tuple[int, int]) -> tuple[Points, Triangles]:
    """Cube without some of its sides, each an axis and a sign."""
    v, f = surface(SOLIDS["cube"])
    missing = [(v[f][:, :, axis] == sign).all(axis=1) for axis, sign in sides]
    return v, f[~np.any(missing, axis=0)]


def test_majority_and_threshold_on_open_surfaces() -> None:
    middle = np.zeros((1, 3))
    # From the middle of a cube each side fills a sixth of the sphere: 5/6 is a clear majority, yet below 0.9.
    one = without_sides((0, 1))
    assert inside_by_rays(middle, *one).all()
    assert not inside_by_winding(middle, *one).any()
    assert inside_by_winding(middle, *one, threshold=0.8).all()
    # 4/6 is undecided, so that the winding number has the last word.
    assert not inside_by_rays(middle, *without_sides((0, 1), (1, 1))).any()


def test_where_the_methods_differ() -> None:
    # A block with a hole drilled into it, and a point in the hole, which few rays leave.
    block = cells(
        lambda p: (np.abs(p).max(axis=-1) < 0.6) & ~((np.abs(p[..., :2]).max(axis=-1) < 0.3) & (p[..., 2] > -0.3))
    )
    v, f = surface(block)
    hole = np.array([[0.0, 0.0, -0.2]])
    assert not inside_by_rays(hole, v, f).any()
    assert not inside_by_winding(hole, v, f).any()
    outer_v, outer_f = surface(SOLIDS["cube"])
    nested = np.concatenate([v, outer_v]), np.concatenate([f, outer_f + len(v)])
    assert not inside_by_rays(hole, *nested).any()
    assert inside_by_winding(hole, *nested).all()
    turned = v, f[:, ::-1]
    assert inside_by_rays(hole, *turned).all()
    assert not inside_by_winding(hole, *turned).any()
    # In the block itself they agree either way.
    deep = np.array([[0.5, 0.5, 0.0]])
    for method in METHODS:
        assert inside(deep, *nested, method).all()
        assert not inside(deep, *turned, method).any()


def test_winding_number_answers_where_there_is_no_embree(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    monkeypatch.setitem(sys.modules, "embreex", None)
    monkeypatch.delitem(sys.modules, "embreex.rtcore_scene", raising=False)
    module._embree_loads.cache_clear()
    try:
        with caplog.at_level(logging.INFO, logger="face_plugin"):
            for _ in range(2):
                answer = inside_by_rays([[0.1, 0.1, 0.1], [0.4, 0.4, 0.4]], corners, faces)
                assert answer.tolist() == [True, False]
    finally:
        module._embree_loads.cache_clear()
    told = [record.levelno for record in caplog.records if "embreex" in record.getMessage()]
    assert told == [logging.INFO]


def test_bad_arguments_are_named() -> None:
    v, f = surface(SOLIDS["cube"])
    nan = np.array([[0.0, np.nan, 0.0]])
    for message, arguments in {
        "points: .*shape": (v[:, :2], v, f),
        "points: finite": (nan, v, f),
        "v: .*shape": (v, v[0], f),
        "v: finite": (v, np.concatenate([v, nan]), f),
        "f: integers": (v, v, f.astype(float)),
        "f: .*shape": (v, v, f[:, :2]),
        "f: indices": (v, v, f + 1),
    }.items():
        for method in METHODS:
            with pytest.raises(ValueError, match=message):
                inside(*arguments, method)
    with pytest.raises(ValueError, match="method: 'rays' or 'winding' is allowed, got 'ray'"):
        inside(v, v, f, "ray")
    with pytest.raises(ValueError, match="directions: at least 1"):
        inside_by_rays(v, v, f, directions=0)
