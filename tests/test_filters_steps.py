"""The steps: each does what the array call does, on the points that are kept."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin import Execution, Params, estimate_normals, filters, reconstruct
from face_plugin.filters import Chain, Interior, Normals, PointSet, Reconstruct, Sculpt, Thin
from face_plugin.sculpt import SculptFile
from face_plugin.shapes import nested_box, spherical_shell, torus


@pytest.fixture(scope="module")
def shape():
    return nested_box(900)


@pytest.fixture(scope="module")
def ring():
    return torus(700)


def test_normals_are_those_of_the_array_call(ring):
    for dtype in (np.float64, np.float32):
        points = ring.points.astype(dtype)
        layer = Normals()(PointSet(points))
        result = estimate_normals(points)
        assert np.array_equal(layer.normals, result.normals)
        assert layer.normals.dtype == dtype
        assert np.array_equal(layer.attributes["strength"], result.strength)
        assert np.array_equal(layer.attributes["confidence"], result.confidence)


def test_points_that_are_not_kept_do_not_conduct_and_get_no_normals(ring):
    keep = np.arange(len(ring)) % 3 > 0
    layer = Normals()(PointSet(ring.points, keep=keep, attributes={"label": np.arange(len(ring))}))
    assert np.array_equal(layer.normals[keep], estimate_normals(ring.points[keep]).normals)
    assert not layer.normals[~keep].any()
    assert np.array_equal(layer.attributes["label"], np.arange(len(ring)))


def test_interior_points_are_dropped_and_normals_stay(shape):
    before = Normals()(PointSet(shape.points))
    layer = Interior()(before)
    assert np.array_equal(layer.normals, before.normals)
    assert np.array_equal(layer.keep, ~layer.attributes["interior"])
    expected = estimate_normals(shape.points, filter_interior=True).interior
    assert np.array_equal(layer.attributes["interior"], expected)
    assert before.keep.all()


def test_another_alpha_needs_no_other_solve(shape):
    stages = []
    chain = Chain([Normals(), Interior(0.05)])
    chain(PointSet(shape.points), progress=lambda stage, fraction: stages.append((stage, fraction)))
    assert stages.count(("poisson", 1.0)) == 1


def test_a_chain_is_the_reconstruction_of_the_array_call(shape):
    params = Params(alpha=0.02)
    layer = Chain([Normals(params), Interior(), Reconstruct(depth=5)])(PointSet(shape.points))
    surface = reconstruct(shape.points, params, depth=5)
    assert np.array_equal(layer.surface.vertices, surface.vertices)
    assert np.array_equal(layer.surface.faces, surface.faces)
    assert np.array_equal(layer.surface.densities, surface.densities)


def test_thinning_keeps_a_poisson_disk_subset_of_what_was_kept(ring):
    start = np.arange(len(ring)) % 5 > 0
    layer = Thin(0.3)(PointSet(ring.points, keep=start))
    kept = ring.points[layer.keep]
    assert not layer.keep[~start].any()
    assert cKDTree(kept).query(kept, k=2)[0][:, 1].min() >= 0.3
    # Maximal: each point left out has a kept one within the distance.
    assert cKDTree(kept).query(ring.points[start])[0].max() < 0.3
    assert np.array_equal(Thin(0.3)(PointSet(ring.points, keep=start)).keep, layer.keep)
    assert not np.array_equal(Thin(0.3, seed=1)(PointSet(ring.points, keep=start)).keep, layer.keep)


def test_thinning_nothing_is_nothing():
    layer = Thin(0.3)(PointSet(np.eye(3), keep=[False] * 3))
    assert not layer.keep.any()


def test_a_large_cloud_is_solved_in_tiles_and_classified_in_the_same_pass():
    shape = nested_box(2500)
    tiles = Execution(tile_points=1500, engine="serial")
    expected = estimate_normals(shape.points, filter_interior=True, execution=tiles)
    stages = []
    layer = Chain([Normals(execution=tiles), Interior()])(
        PointSet(shape.points), progress=lambda stage, fraction: stages.append((stage, fraction))
    )
    assert np.array_equal(layer.normals, expected.normals)
    assert np.array_equal(layer.attributes["interior"], expected.interior)
    assert stages.count(("coarse", 1.0)) == 1
    alone = Interior(execution=tiles)(PointSet(shape.points))
    assert np.array_equal(alone.keep, layer.keep)
    # Another alpha takes another pass in tiles, with the same result as from the start.
    other = Interior(0.3)(Normals(execution=tiles)(PointSet(shape.points)))
    assert np.array_equal(
        other.attributes["interior"],
        estimate_normals(shape.points, Params(alpha=0.3), filter_interior=True, execution=tiles).interior,
    )


def test_a_sculpted_cloud_is_solved_in_one_piece_whatever_its_size(tmp_path):
    ring = torus(1600)
    path = tmp_path / "edits.json"
    SculptFile(charges=((0.0, 0.0, 0.0),)).save(path)
    tiles = Execution(tile_points=1000, engine="serial")
    layer = Chain([Sculpt(str(path), execution=tiles), Normals()])(PointSet(ring.points))
    assert np.array_equal(layer.normals, estimate_normals(ring.points, sculpt=path, execution=tiles).normals)


@pytest.mark.parametrize("distance", [0.0, -1.0, np.inf, np.nan, True, "1"])
def test_distances_that_thinning_refuses(distance):
    with pytest.raises(ValueError, match="distance must be a finite number > 0"):
        Thin(distance)


@pytest.mark.parametrize("seed", [-1, 0.5, True])
def test_seeds_that_thinning_refuses(seed):
    with pytest.raises(ValueError, match="seed must be an integer >= 0"):
        Thin(0.1, seed)


@pytest.mark.parametrize("alpha", [0.0, 1.0, "thick"])
def test_alphas_that_the_interior_test_refuses(alpha):
    with pytest.raises(ValueError, match="alpha must be"):
        Interior(alpha)


def test_a_sculpt_acts_on_what_follows(tmp_path):
    shell = spherical_shell(1500)
    path = tmp_path / "cavity.json"
    SculptFile(charges=((0.0, 0.0, 0.0),)).save(path)
    before = Normals()(PointSet(shell.points))
    after = Chain([Sculpt(str(path)), Normals()])(before)
    # The cavity is read as another body without the charge (about 77 % aligned), and as empty space with it.
    assert ((before.normals * shell.normals).sum(axis=1) > 0).mean() < 0.9
    assert ((after.normals * shell.normals).sum(axis=1) > 0).mean() > 0.99
    # The cage that the first layer holds is untouched.
    assert np.array_equal(before.cage.normals(), before.normals)


def test_a_sculpt_needs_a_file():
    with pytest.raises(ValueError, match="file must be the path of a sculpt file, found ''"):
        Sculpt("")


def test_a_surface_without_normals_or_points_says_so(ring):
    with pytest.raises(ValueError, match="a surface needs normals"):
        Reconstruct()(PointSet(ring.points))
    with pytest.raises(ValueError, match="none of the 700 are kept"):
        Reconstruct()(PointSet(ring.points, ring.normals, np.zeros(700, dtype=bool)))


def test_strays_are_of_no_surface_without_the_interior_step_either(ring):
    points = np.concatenate([ring.points, [[9.0, 0.0, 0.0]]])
    layer = Chain([Normals(), Reconstruct(depth=5)])(PointSet(points))
    assert layer.keep.all()
    expected = reconstruct(points, depth=5, filter_interior=False)
    assert np.array_equal(layer.surface.vertices, expected.vertices)
    assert np.abs(layer.surface.vertices).max() < 5


def test_the_old_name_of_the_reconstruction_warns_and_works():
    with pytest.warns(DeprecationWarning, match="filters.Surface is now .*Reconstruct$"):
        old = filters.Surface
    assert old is Reconstruct
    assert Reconstruct.name == "surface"
    assert Chain.from_dict({"steps": [{"filter": "surface", "depth": 6}]}).steps == (Reconstruct(6),)
    with pytest.raises(AttributeError, match="no attribute 'Surfaces'"):
        filters.Surfaces  # noqa: B018
