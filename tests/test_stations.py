"""The station of a single view, told by how the density of its points falls off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from face_plugin import Side, estimate_normals, shapes
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.shapes.scans import camera_rays, ring_rays, scan_boxes, sphere_rays
from face_plugin.sides.patches import planes_of
from face_plugin.sides.stations import find_station

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
    around = Neighbourhood(points - points.mean(axis=0))
    station = find_station(around, planes_of(around).lines)
    return None if station is None else np.asarray(station.viewpoints)[0] + points.mean(axis=0)


@pytest.mark.parametrize("rays", RAYS)
def test_the_station_of_a_single_view_is_found(rays):
    points, _, station = scan(rays)
    # Of 40 m: its place over the ground is told well, and its height little. Measured: 0.2 to 3 m.
    assert np.linalg.norm(found(points) - station) < 5.0


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


def test_several_views_are_not_taken_for_one():
    views = [[-10.0, -8.0, 1.8], [11.0, -9.0, 1.8], [0.0, 10.0, 1.8]]
    points = scan_boxes(YARD, views, RAYS["all round"], 9000, np.random.default_rng(0)).points
    assert found(points) is None
