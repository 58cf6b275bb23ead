"""What users scan: rooms from inside, terrain, crates sampled at random, bores, strays, noise."""

import numpy as np
import pytest

import face_plugin
from face_plugin import estimate_normals, examples, shapes
from face_plugin.neighbourhood import Neighbourhood
from face_plugin.sides.patches import planes_of
from face_plugin.sides.sensors import Sensors
from face_plugin.sides.sights import sights


def right(normals, truth):
    """Share of normals on the right side."""
    return float((np.einsum("nd,nd->n", normals, truth) > 0).mean())


def rectangle(corner, one, other, n, rng):
    """Points at random on a rectangle, with the normal `one` x `other`."""
    corner, one, other = (np.asarray(v, dtype=float) for v in (corner, one, other))
    normal = np.cross(one, other)
    area = np.linalg.norm(normal)
    count = round(n * area)
    share = rng.random((count, 2))
    return corner + share[:, :1] * one + share[:, 1:] * other, np.tile(normal / area, (count, 1))


def box_faces(lower, upper, n, rng, *, sides=range(6), hollow=False):
    """Faces of a box, `n` points a unit of area; sides 0 to 5 are -x, +x, -y, +y, -z, +z."""
    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    found = []
    for side in sides:
        axis, high = divmod(side, 2)
        edges = np.diag(upper - lower)
        one, other = edges[(axis + 1) % 3], edges[(axis + 2) % 3]
        corner = lower + high * edges[axis]
        points, normals = rectangle(corner, *((one, other) if high else (other, one)), n, rng)
        found.append((points, -normals if hollow else normals))
    return found


def joined(parts):
    points, normals = zip(*parts, strict=True)
    return np.concatenate(points), np.concatenate(normals)


def crate(density, seed):
    """Open box with walls of 0.06 whose mouth is as wide as half its depth, sampled at random."""
    rng = np.random.default_rng(seed)
    outer, inner = ((0.0, 0.0, 0.0), (1.0, 0.8, 0.7)), ((0.06, 0.06, 0.06), (0.94, 0.74, 0.7))
    parts = box_faces(*outer, density, rng, sides=range(5)) + box_faces(
        *inner, density, rng, sides=range(5), hollow=True
    )
    # The rim: four strips between the two mouths.
    for lower, upper in (
        ((0, 0, 0.7), (1, 0.06, 0.7)),
        ((0, 0.74, 0.7), (1, 0.8, 0.7)),
        ((0, 0.06, 0.7), (0.06, 0.74, 0.7)),
        ((0.94, 0.06, 0.7), (1, 0.74, 0.7)),
    ):
        width, depth = upper[0] - lower[0], upper[1] - lower[1]
        parts.append(rectangle(lower, (width, 0, 0), (0, depth, 0), density, rng))
    return joined(parts)


def drilled(n, seed):
    """Block of 2 x 1 x 1 with three bores of diameter 0.3 right through it, spread evenly."""
    rng = np.random.default_rng(seed)
    density = shapes.sampling.OVERSAMPLING * n / 10.0
    points, normals = joined(box_faces((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), density, rng))
    parts = []
    in_a_bore = np.zeros(len(points), dtype=bool)
    for x in (0.4, 1.0, 1.6):
        in_a_bore |= np.hypot(points[:, 0] - x, points[:, 1] - 0.5) < 0.15
        count = round(density * 2 * np.pi * 0.15)
        turn, height = rng.random((2, count)) * [[2 * np.pi], [1.0]]
        around = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)])
        parts.append((np.column_stack([x + 0.15 * around[:, 0], 0.5 + 0.15 * around[:, 1], height]), -around))
    points, normals = joined([(points[~in_a_bore], normals[~in_a_bore]), *parts])
    kept = shapes.evenly(points, n, rng, normals=normals)
    return points[kept], normals[kept]


def test_a_room_with_its_viewpoints_faces_inward_and_loses_nothing():
    room = examples.load("room", 4000)
    result = estimate_normals(room.points, viewpoints=room.viewpoints, filter_interior=True)
    assert right(result.normals, room.normals) >= 0.995
    assert (~result.kept).mean() <= 0.005


def test_which_viewpoint_saw_which_point_may_be_told():
    room = examples.load("room", 2000)
    # The scan lists the points of the first viewpoint first; of some it is not known.
    seen_from = (np.arange(2000) >= 1000).astype(int)
    seen_from[::7] = -1
    result = estimate_normals(room.points, viewpoints=room.viewpoints, seen_from=seen_from)
    assert right(result.normals, room.normals) >= 0.995


def test_terrain_seen_from_above_points_up():
    terrain = examples.load("terrain", 3000)
    up = estimate_normals(terrain.points, up=terrain.up).normals
    assert right(up, terrain.normals) >= 0.995
    down = estimate_normals(terrain.points, up=-terrain.up).normals
    assert right(down, terrain.normals) <= 0.005


def test_terrain_without_a_hint_has_one_side():
    terrain = examples.load("terrain", 3000)
    share = right(estimate_normals(terrain.points).normals, terrain.normals)
    assert max(share, 1.0 - share) >= 0.99


@pytest.mark.parametrize("name", ["street", "frame"])
def test_a_street_and_a_frame_without_a_hint_face_where_they_were_seen_from(name):
    scan = examples.load(name)
    assert right(estimate_normals(scan.points).normals, scan.normals) > 0.96


def row_of_houses(density, seed):
    """Fronts of houses that stand back and forward, the walls between them, and the street before them."""
    rng = np.random.default_rng(seed)
    depths, widths, heights = (0.0, 1.2, -0.8, 0.6), (6.0, 5.0, 7.0, 4.0), (8.0, 10.0, 7.0, 9.0)
    parts, x = [rectangle((-2, -8, 0), (26, 0, 0), (0, 7, 0), density / 2, rng)], 0.0
    for k, (depth, width, height) in enumerate(zip(depths, widths, heights, strict=True)):
        parts.append(rectangle((x, depth, 0), (width, 0, 0), (0, 0, height), density, rng))
        x += width
        if k + 1 < len(depths):
            step = depths[k + 1] - depth
            parts.append(rectangle((x, depth, 0), (0, step, 0), (0, 0, min(height, heights[k + 1])), density, rng))
    return joined(parts)


def trees_from_above(density, seed):
    """Ground seen from above, but not below the crowns, of which the upper halves are seen."""
    rng = np.random.default_rng(seed)
    ground = rectangle((0, 0, 0), (30, 0, 0), (0, 30, 0), density, rng)
    shown, parts = np.ones(len(ground[0]), dtype=bool), []
    for x in (4.0, 12.0, 20.0, 26.0):
        for y in (5.0, 14.0, 24.0):
            radius = rng.uniform(1.2, 2.2)
            up = rng.normal(size=(round(density * 2 * np.pi * radius**2), 3))
            up[:, 2] = np.abs(up[:, 2])
            up /= np.linalg.norm(up, axis=1, keepdims=True)
            parts.append((np.array([x, y, 6.0]) + radius * up, up))
            shown &= np.hypot(ground[0][:, 0] - x, ground[0][:, 1] - y) > radius
    return joined([(ground[0][shown], ground[1][shown]), *parts])


@pytest.mark.parametrize("scene", [row_of_houses(30.0, 0), trees_from_above(9.0, 0)], ids=["houses", "trees"])
def test_parts_of_an_open_scan_are_on_one_side_without_a_hint(scene):
    points, truth = scene
    share = right(estimate_normals(points).normals, truth)
    assert max(share, 1.0 - share) > 0.995


def test_a_street_has_no_point_that_its_own_sheet_hides():
    # The ground far off is seen at a few degrees: its points lie behind one another.
    around = Neighbourhood(examples.load("street").points)
    sensors = Sensors(examples.load("street").viewpoints)
    seen = sights(around, sensors, planes_of(around).lines).any(axis=1)
    assert seen.mean() > 0.9


def test_a_crate_sampled_at_random_is_right_inside_and_loses_nothing():
    points, normals = crate(1200, 0)
    result = estimate_normals(points, filter_interior=True)
    assert right(result.normals, normals) >= 0.99
    assert (~result.kept).mean() <= 0.01


def test_a_pipe_whose_wall_is_as_thin_as_the_spacing_is_right_inside():
    rng = np.random.default_rng(0)
    parts = []
    for radius, side in ((0.2, 1.0), (0.16, -1.0)):
        angle = rng.uniform(0, 2 * np.pi, round(3500 * radius / 0.36))
        out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        parts.append((radius * out + np.outer(rng.uniform(0, 3, len(angle)), [0, 0, 1.0]), side * out))
    for height, side in ((0.0, -1.0), (3.0, 1.0)):
        angle, radius = rng.uniform(0, 2 * np.pi, 24), np.sqrt(rng.uniform(0.16**2, 0.2**2, 24))
        rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(24, height)], axis=1)
        parts.append((rim, np.tile([0, 0, side], (24, 1))))
    points, truth = joined(parts)
    result = estimate_normals(points, filter_interior=True)
    assert right(result.normals, truth) > 0.97
    assert result.interior.mean() < 0.01


def bottle(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Turn a profile, up the outside and down the inside: the neck is six walls wide, and the walls a spacing thick."""
    profile = np.array(
        [
            [0, 0],
            [0.4, 0],
            [0.4, 1.2],
            [0.12, 1.5],
            [0.12, 2],
            [0.08, 2],
            [0.08, 1.5],
            [0.36, 1.2],
            [0.36, 0.04],
            [0, 0.04],
        ]
    )
    start, step = profile[:-1], np.diff(profile, axis=0)
    length = np.linalg.norm(step, axis=1)
    area = length * (2 * start + step)[:, 0]
    rng = np.random.default_rng(0)
    piece = np.repeat(np.arange(len(step)), rng.multinomial(count, area / area.sum()))
    start, step, turn = start[piece], step[piece], rng.uniform(0, 2 * np.pi, count)
    # Even by area: the square of the radius is even along a cone.
    inner, outer, u = start[:, 0] ** 2, (start + step)[:, 0] ** 2, rng.random(count)
    slanted = np.abs(step[:, 0]) > 0
    along = np.where(slanted, np.sqrt(inner + u * (outer - inner)) - start[:, 0], 0) / np.where(slanted, step[:, 0], 1)
    along = np.where(slanted, along, u)
    radius, height = (start + along[:, None] * step).T
    out = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    normal = np.stack([step[:, 1], -step[:, 0]], axis=1) / length[piece, None]
    return np.column_stack([radius[:, None] * out, height]), np.column_stack([normal[:, :1] * out, normal[:, 1]])


def test_a_bottle_is_right_inside_though_nothing_but_its_neck_leads_there():
    points, truth = bottle(9000)
    result = estimate_normals(points, filter_interior=True)
    assert right(result.normals, truth) > 0.99
    assert result.interior.mean() < 0.001


def test_strays_around_a_sphere_are_set_aside_and_nothing_is_lost():
    count = 3000
    shape = shapes.with_outliers(shapes.sphere(count), 0.01, seed=3)
    result = estimate_normals(shape.points, filter_interior=True)
    assert result.kept[:count].all()
    assert right(result.normals[:count], shape.normals[:count]) == 1.0
    # Those that happen to lie on the sphere are no strays.
    off = np.abs(np.linalg.norm(shape.points[count:], axis=1) - 1.0) > 0.25
    assert result.strays[count:][off].mean() >= 0.9


def test_bores_are_right_and_kept():
    points, normals = drilled(5000, 0)
    result = estimate_normals(points, filter_interior=True)
    bore = (np.abs(normals[:, 2]) < 1e-9) & (np.abs(points[:, 1] - 0.5) < 0.16) & (points[:, 0] > 0.2)
    bore &= points[:, 0] < 1.8
    assert bore.sum() > 500
    assert right(result.normals, normals) >= 0.99
    assert right(result.normals[bore], normals[bore]) >= 0.99
    assert (~result.kept).mean() <= 0.01


@pytest.mark.parametrize("noise", [0.5, 1.0])
def test_a_noisy_sphere_loses_next_to_nothing(noise):
    count = 3000
    # In spacings: the square root of the area a point.
    shape = shapes.with_noise(shapes.sphere(count), noise * np.sqrt(4 * np.pi / count), seed=1)
    result = estimate_normals(shape.points, filter_interior=True)
    assert (~result.kept).mean() <= 0.001


def test_confidence_is_in_the_side_that_sensors_saw():
    room = examples.load("room", 2000)
    result = estimate_normals(room.points, viewpoints=room.viewpoints)
    good = np.einsum("nd,nd->n", result.normals, room.normals) > 0
    assert np.median(result.confidence[good]) > 0.5
    # In tiles as well, which find it out by themselves.
    tiled = estimate_normals(
        room.points, execution=face_plugin.Execution(tile_points=1000, engine="serial"), viewpoints=room.viewpoints
    )
    assert np.median(tiled.confidence[good]) > 0.5


@pytest.mark.parametrize("seed", range(3))
def test_a_piece_of_a_floor_in_whole_steps_has_one_side(seed):
    """Its points lie in few heights, above one another: that is no plate thinner than the spacing."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 0.84, 1800), rng.uniform(0, 0.54, 1800)
    z = 0.02 * np.sin(4 * x) * np.cos(3 * y) + rng.normal(0, 0.004, 1800)
    up = estimate_normals(np.round(np.stack([x, y, z], axis=1), 2)).normals[:, 2] > 0
    # Up to a flip. Measured: all of them; with plates 95 to 98 %.
    assert max(up.mean(), 1 - up.mean()) > 0.998
