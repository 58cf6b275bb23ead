"""The stations of scans, told by how the density of their points falls off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from face_plugin import Execution, Params, Side, estimate_normals, shapes
from face_plugin.cloud import prepare
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.shapes.scans import camera_rays, ring_rays, scan_boxes, sphere_rays
from face_plugin.sides import belief
from face_plugin.sides.belief import believed_stations
from face_plugin.sides.ray_density import RayDensity
from face_plugin.sides.sensors import Sensors

YARD = [
    ((-20.0, -20.0, -0.5), (20.0, 20.0, 0.0)),
    ((5.0, -4.0, 0.0), (9.0, 1.0, 3.0)),
    ((-8.0, 3.0, 0.0), (-4.0, 6.0, 2.0)),
    ((2.0, 7.0, 0.0), (4.0, 8.0, 1.5)),
]
STATION = np.array([0.3, -0.5, 1.8])
RAYS = {
    "all round": sphere_rays(30_000),
    "rings": ring_rays(32, 1200),
    "camera": camera_rays(160, 120, [1.0, 0.2, -0.35]),
}


def scan(rays, seed=0):
    rng = np.random.default_rng(seed)
    made = scan_boxes(YARD, [STATION], RAYS[rays], 7000, rng, noise=0.002)
    turn = Rotation.random(random_state=seed).as_matrix()
    shift = np.array([4e5, 5e6, 100.0])
    return made.points @ turn.T + shift, made.normals @ turn.T, STATION @ turn.T + shift


def found(points):
    cloud = prepare(points)
    around = Neighbourhood(cloud.points)
    believed = believed_stations(around)
    return None if believed is None else cloud.frame.from_unit(np.asarray(believed[0].viewpoints))


@pytest.mark.parametrize("rays", RAYS)
def test_the_station_of_a_single_view_is_found(rays):
    points, _, station = scan(rays)
    # Of 40 m: its place over the ground is told well, and its height little. Measured: 0.2 to 3 m.
    stations = found(points)
    # Of a camera's rows, thinned at random, two beside one another explain the chance a little better than one.
    assert len(stations) <= (2 if rays == "camera" else 1)
    assert np.linalg.norm(stations - station, axis=1).max() < 5.0


@pytest.mark.parametrize("rays", RAYS)
def test_a_single_view_faces_its_station_without_being_told(rays):
    points, normals, _ = scan(rays, 1)
    result = estimate_normals(points)
    assert ((result.normals * normals).sum(axis=1) > 0).mean() > 0.995
    # It might be the mirror image of the station below the ground: the side is called chosen.
    assert (result.sides == Side.CHOSEN).mean() > 0.95


@pytest.mark.parametrize("make", [shapes.sphere, shapes.torus, shapes.box, shapes.teapot])
def test_even_samplings_were_scanned_from_nowhere(make):
    assert found(make(3000, 0).points) is None


def test_a_random_sampling_was_scanned_from_nowhere():
    corner = np.random.default_rng(0).uniform(0, 1, (6000, 3))
    corner[np.arange(6000), np.arange(6000) % 3] = 0.0
    assert found(corner) is None


ROOM = [
    ((0.0, 0.0, 0.0), (6.0, 4.5, 2.6)),
    ((1.5, 1.5, 0.0), (2.7, 2.1, 0.8)),
    ((4.4, 3.4, 0.0), (5.4, 4.0, 1.9)),
    ((3.4, 0.6, 0.9), (3.9, 1.1, 1.4)),
]
VIEWS = np.array([[0.8, 3.4, 1.4], [5.2, 0.7, 1.5], [3.2, 2.9, 1.3]])


def room(views, seed=0):
    turn = Rotation.random(random_state=seed).as_matrix()
    made = scan_boxes(ROOM, VIEWS[:views], sphere_rays(30_000), 15_000, np.random.default_rng(seed), noise=0.003)
    return made.points @ turn.T, made.normals @ turn.T, VIEWS[:views] @ turn.T


@pytest.mark.parametrize("views", [1, 2, 3])
def test_the_stations_of_several_views_are_found(views):
    points, _, true = room(views)
    stations = found(points)
    # One more that is far off may stand for what they leave unexplained.
    assert views <= len(stations) <= views + 1
    # Of 6 m. Measured: 0.02 to 0.6 m.
    assert np.linalg.norm(stations[:, None] - true, axis=2).min(axis=0).max() < 1.0


@pytest.mark.parametrize("views", [1, 2, 3])
def test_what_stands_in_a_closed_room_is_not_taken_for_what_lies_inside_a_body(views):
    points, normals, _ = room(views, 1)
    result = estimate_normals(points, filter_interior=True)
    assert ((result.normals * normals).sum(axis=1) > 0).mean() > 0.995
    assert not result.interior.any()


@pytest.mark.parametrize("seed", [2, 3])
def test_what_stands_in_a_room_whose_floor_was_taken_out_faces_the_same_space(seed):
    """Light gets in from below: nothing in it is dark."""
    made = scan_boxes(ROOM, VIEWS[:2], sphere_rays(30_000), 12_000, np.random.default_rng(seed), noise=0.003)
    above = made.points[:, 2] > 0.02
    result = estimate_normals(made.points[above])
    assert ((result.normals * made.normals[above]).sum(axis=1) > 0).mean() > 0.998


@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (1.0, 0.6, 0.4)])
def test_a_body_sampled_by_rays_from_its_middle_was_not_scanned_from_there(axes):
    ray = np.random.default_rng(0).normal(size=(6000, 3))
    points = ray / np.linalg.norm(ray, axis=1, keepdims=True) * np.asarray(axes)
    result = estimate_normals(points)
    assert ((result.normals * points).sum(axis=1) > 0).all()


def test_a_mirror_image_behind_a_wall_is_left_out(monkeypatch):
    points, _, true = room(2)
    cloud = prepare(points)
    # From behind the wall at x = 0, which hides all else from it.
    turn = Rotation.random(random_state=0).as_matrix()
    places = cloud.frame.to_unit(np.vstack([true, [[-0.8, 3.4, 1.4]] @ turn.T]))
    monkeypatch.setattr(belief, "find_stations", lambda seen: Sensors(places))
    believed = believed_stations(Neighbourhood(cloud.points))
    assert np.array_equal(believed[0].viewpoints, places[:2])


def test_one_wrong_among_several_is_not_believed(monkeypatch):
    points, _, true = room(3, 1)
    cloud = prepare(points)
    turn = Rotation.random(random_state=1).as_matrix()
    places = cloud.frame.to_unit(np.vstack([true[:2], [[2.3, -0.8, 0.6]] @ turn.T]))
    for found_there, lost, kept in (
        (places, belief.LOST, False),
        (places, np.inf, True),
        (places[:2], belief.LOST, True),
    ):
        monkeypatch.setattr(belief, "find_stations", lambda seen, found_there=found_there: Sensors(found_there))
        monkeypatch.setattr(belief, "LOST", lost)
        assert (believed_stations(Neighbourhood(cloud.points)) is not None) == kept


def test_strays_do_not_tell_otherwise():
    points, normals, _ = scan("camera", 1)
    lower, upper = points.min(axis=0), points.max(axis=0)
    strays = np.random.default_rng(0).uniform(lower - (upper - lower), 2 * upper - lower, (len(points) // 50, 3))
    result = estimate_normals(np.concatenate([points, strays]))
    assert ((result.normals[: len(points)] * normals).sum(axis=1) > 0).mean() > 0.99


def test_tiles_find_the_stations_together():
    points, normals, _ = room(2, 1)
    execution = Execution(tile_points=5000, engine="serial")
    result = estimate_normals(points, filter_interior=True, execution=execution)
    assert ((result.normals * normals).sum(axis=1) > 0).mean() > 0.995
    assert not result.interior.any()
    assert (result.sides != Side.SENSORS).all()


def test_the_field_alone_asks_no_station():
    points, normals, _ = room(2, 1)
    result = estimate_normals(points, Params(angles="field"))
    assert ((result.normals * normals).sum(axis=1) > 0).mean() < 0.1


def test_what_lies_inside_a_body_stays_inside():
    nested = shapes.nested_box(6000)
    result = estimate_normals(nested.points, filter_interior=True)
    assert (result.interior == nested.interior).mean() > 0.99


def test_uneven_samplings_of_a_body_were_not_scanned_from_within():
    # Rays even in angle from the middle of a long body that holds another, and a ball stretched threefold.
    rng = np.random.default_rng(0)
    rays = rng.normal(size=(2, 8000, 3))
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    long = np.array([2.0, 1.0, 1.0])
    inner = 0.4 * rays[1, :800]
    for outer in (rays[0] / np.linalg.norm(rays[0] / long, axis=1)[:, None], rays[0] * [3.0, 1.0, 1.0]):
        result = estimate_normals(np.vstack([outer, inner]), filter_interior=True)
        assert ((result.normals[:8000] * outer).sum(axis=1) > 0).all()
        assert result.interior[8000:].all()
        assert not result.interior[:8000].any()


def test_rows_of_a_torus_face_outward():
    # The density is that of rows seen from the middle, from which half of them is in sight.
    around, turn = np.meshgrid(2 * np.pi * np.arange(90) / 90, 2 * np.pi * np.arange(220) / 220, indexing="ij")
    outward = np.stack([np.cos(around) * np.cos(turn), np.cos(around) * np.sin(turn), np.sin(around)], axis=-1)
    middle = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=-1)
    result = estimate_normals((middle + 0.35 * outward).reshape(-1, 3))
    assert ((result.normals * outward.reshape(-1, 3)).sum(axis=1) > 0).all()


def test_the_law_of_rows_needs_no_surface():
    # One row of rays meets a wall at a slant: spacings go as d^2 here, and not as the root of d^3.
    turn = np.linspace(-1.2, 1.2, 400)
    row = np.column_stack([np.tan(turn), np.ones(400), np.zeros(400)])
    points = np.vstack([row + np.array([0.0, 0.0, 5.0 * k]) for k in range(4)])
    seen = RayDensity.of(Neighbourhood(points), np.tile([0.0, 1.0, 0.0], (1600, 1)), np.arange(1600))
    assert seen.in_row.all()
    station = np.array([[0.0, 0.0, 0.0]])
    first = points[:, 2] == 0.0
    error = (seen.area + np.log(seen.expected(station)[0]))[first][5:-5]
    assert np.abs(error - np.median(error)).max() < 0.05


def test_many_views_are_not_taken_for_few():
    turn = 2 * np.pi * np.arange(10) / 10
    views = np.column_stack([12 * np.cos(turn), 12 * np.sin(turn), np.full(10, 1.8)])
    points = scan_boxes(YARD, views, RAYS["all round"], 9000, np.random.default_rng(0)).points
    around = Neighbourhood(points)
    believed = believed_stations(around)
    assert believed is None or ((believed[1] * [0, 0, 1]).sum(axis=1)[points[:, 2] < 0.01] > 0).mean() > 0.99
