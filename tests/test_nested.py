"""Bodies within bodies, read as solids or as cavities."""

import numpy as np
import pytest

from face_plugin import Execution, FaCE, Params, estimate_normals, orient_normals, reconstruct, shapes
from face_plugin.app.cli import main
from face_plugin.filters import Chain, Interior, Normals, PointSet
from face_plugin.io import CloudFile, read_cloud, write_cloud

CAVITY = Params(nested="cavity")
EITHER = [None, Execution(tile_points=1500, engine="serial")]
either = pytest.mark.parametrize("execution", EITHER, ids=["one piece", "tiles"])


def balls(*sizes, at=(0.0, 0.0, 0.0)):
    """Balls within balls: points, outward normals, and which ball each point is of."""
    made = [shapes.sphere(round(2400 * size**2), seed=k, radius=size) for k, size in enumerate(sizes)]
    points = np.concatenate([ball.points for ball in made]) + at
    return points, np.concatenate([ball.normals for ball in made]), np.repeat(np.arange(len(made)), [*map(len, made)])


def outward(normals, truth):
    return np.einsum("nd,nd->n", normals, truth) > 0


@either
@pytest.mark.parametrize("sizes", [(1.0, 0.6), (1.0, 0.7, 0.4)])
def test_sides_alternate_from_outside_in(sizes, execution):
    points, normals, ball = balls(*sizes)
    found = estimate_normals(points, CAVITY, filter_interior=True, execution=execution)
    right = outward(found.normals, normals) == (ball % 2 == 0)
    assert right.mean() > 0.999
    assert not found.interior.any()
    if execution is None:
        solid = estimate_normals(points, filter_interior=True)
        assert outward(solid.normals, normals).mean() > 0.999
        assert np.array_equal(solid.interior, ball > 0)


@either
def test_a_box_in_a_ball_and_one_beside_it(execution):
    nested = shapes.nested_box(3600)
    beside, normals, _ = balls(0.6, at=(3.0, 0, 0))
    points = np.concatenate([nested.points, beside])
    found = estimate_normals(points, CAVITY, filter_interior=True, execution=execution)
    box = np.concatenate([nested.interior, np.zeros(len(beside), dtype=bool)])
    from_middle = np.concatenate([nested.points, normals])
    assert (outward(found.normals, from_middle) == ~box).mean() > 0.998
    assert not found.interior.any()


def test_points_at_random_and_noise():
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(4500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inner = np.arange(4500) >= 3000
    points = normals * np.where(inner, 0.6, 1.0)[:, None] + rng.normal(0, 0.01, (4500, 3))
    assert (outward(estimate_normals(points, CAVITY).normals, normals) == ~inner).mean() > 0.999


@pytest.mark.parametrize("shape", [shapes.cup(2500), shapes.bowl(2500), shapes.torus(2500), shapes.two_spheres(2500)])
def test_without_a_body_in_another_nothing_changes(shape):
    """A dent, a bore, bodies that cross or touch: the same bits."""
    solid, cavity = (
        estimate_normals(shape.points, Params(nested=how), filter_interior=True) for how in ("solid", "cavity")
    )
    assert np.array_equal(solid.normals, cavity.normals)
    assert np.array_equal(solid.interior, cavity.interior)


def test_a_deep_dent_and_an_open_sheet_inside_are_not_turned():
    """A dent in a ball, and half a sphere within it: neither is closed."""
    ball = shapes.sphere(3000)
    mouth = ball.points[:, 2] > 0.8
    dent = shapes.sphere(1200, radius=0.6).points + np.array([0.0, 0.0, 0.2])
    half = shapes.sphere(700, radius=0.3).points
    points = np.concatenate([ball.points[~mouth], dent[dent[:, 2] < 0.6], half[half[:, 2] > 0]])
    solid, cavity = (estimate_normals(points, Params(nested=how)).normals for how in ("solid", "cavity"))
    assert np.array_equal(solid, cavity)


def test_in_the_plane():
    angle = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points, normals = np.concatenate([ring, 0.5 * ring[::2]]), np.concatenate([ring, ring[::2]])
    inner = np.arange(360) >= 240
    found = estimate_normals(points, CAVITY, filter_interior=True)
    assert np.array_equal(outward(found.normals, normals), ~inner)
    assert not found.interior.any()


def test_what_a_sensor_saw_stays():
    """A camera between two balls sees the inside of one and the outside of the other."""
    points, normals, ball = balls(1.0, 0.5)
    views = [[0.75, 0, 0], [-0.75, 0, 0], [0, 0.75, 0], [0, -0.75, 0], [0, 0, 0.75], [0, 0, -0.75]]
    found = estimate_normals(points, CAVITY, viewpoints=views)
    assert (outward(found.normals, normals) == (ball == 1)).mean() > 0.999


def test_the_surface_has_both_walls():
    points, _, _ = balls(1.0, 0.6)
    radius = [np.linalg.norm(reconstruct(points, params, depth=6).vertices, axis=1) for params in (None, CAVITY)]
    assert radius[0].min() > 0.95
    assert (np.abs(radius[1] - 0.6) < 0.05).any()
    assert ((np.abs(radius[1] - 1.0) < 0.05) | (np.abs(radius[1] - 0.6) < 0.05)).all()


@pytest.mark.parametrize("alpha", ["dense", 0.05])
def test_a_given_alpha_spares_the_wall_of_the_cavity(alpha):
    points, _, ball = balls(1.0, 0.6)
    solid, cavity = FaCE(points).interior(alpha), FaCE(points, CAVITY).interior(alpha)
    assert solid[ball == 1].all()
    assert not cavity[ball == 1].any()
    assert np.array_equal(solid[ball == 0], cavity[ball == 0])


def test_given_normals_and_a_charge_in_the_cavity():
    points, normals, ball = balls(1.0, 0.6)
    turned = orient_normals(points, normals, CAVITY)
    assert np.array_equal(outward(turned, normals), ball == 0)
    face = FaCE(points, CAVITY)
    face.add_charges([[0.0, 0.0, 0.0]])
    assert np.array_equal(outward(face.normals(), normals), ball == 0)


def test_chains_and_the_command(tmp_path):
    points, normals, ball = balls(1.0, 0.6)
    path = tmp_path / "chain.toml"
    Chain([Normals(CAVITY), Interior()]).save(path)
    layer = Chain.load(path)(PointSet(points))
    assert np.array_equal(outward(layer.normals, normals), ball == 0)
    assert layer.keep.all()
    cloud, out = tmp_path / "in.ply", tmp_path / "out.ply"
    write_cloud(cloud, CloudFile(points))
    assert main(["normals", str(cloud), "-o", str(out), "--filter-interior", "--nested", "cavity", "--quiet"]) == 0
    assert np.array_equal(outward(read_cloud(out).normals, normals), ball == 0)
