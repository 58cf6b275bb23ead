"""Surfaces of open scans: cut where the points end, and closed bodies as they were."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from tet_meshes import open_edges

from face_plugin import Execution, estimate_normals, examples, reconstruct, shapes
from face_plugin.app.cli import main
from face_plugin.filters import Chain, Interior, Normals, PointSet, Reconstruct
from face_plugin.geometry import local_spacing
from face_plugin.io import CloudFile, write_cloud
from face_plugin.surface import poisson_reconstruction
from face_plugin.trimming import AUTO_DISTANCE, trimmed_by_distance

TERRAIN = examples.load("terrain", 2500)
BALL = shapes.sphere(2500, seed=1)
# A cut is linear along an edge, and the distance to the points bends: measured 1.11 to 1.14.
BENT = 1.2
TILES = Execution(tile_points=1250, engine="serial")


def spacings(points, surface, depth):
    """How far the surface's vertices lie from the points, and the points from these: in spacings."""
    spacing = np.maximum(local_spacing(points), 1.1 * np.ptp(points, axis=0).max() / 2**depth)
    apart, near = cKDTree(points).query(surface.vertices, k=24)
    return apart[:, 0] / spacing[near].mean(axis=1), cKDTree(surface.vertices).query(points)[0] / spacing


def ball_over_floor(gap=0.5):
    floor = np.random.default_rng(0).uniform(-3, 3, (3500, 2))
    floor = np.column_stack([floor, np.full(len(floor), -1 - gap)])
    return np.concatenate([BALL.points, floor])


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"execution": TILES},
        pytest.param({"up": (0, 0, 1)}, marks=pytest.mark.slow),
        pytest.param({"backend": "pymeshlab"}, marks=pytest.mark.slow),
    ],
)
def test_a_terrain_ends_where_its_points_do(options):
    surface = reconstruct(TERRAIN.points, depth=7, **options)
    assert surface.result.open.all()
    away, back = spacings(TERRAIN.points, surface, 7)
    assert away.max() < BENT * AUTO_DISTANCE
    assert (back < 1).mean() > 0.99
    whole = reconstruct(TERRAIN.points, depth=7, trim_distance=None, **options)
    assert spacings(TERRAIN.points, whole, 7)[0].max() > 1.5 * AUTO_DISTANCE
    assert set(np.unique(surface.faces)) == set(range(len(surface.vertices)))
    assert surface.densities is None or len(surface.densities) == len(surface.vertices)


def test_the_border_is_one_smooth_line():
    """Sheets on a grid: a straight border is cut straight, and two spacings out."""
    axis = np.linspace(0.0, 1.0, 41)
    x, y = (values.ravel() for values in np.meshgrid(axis, axis))
    points = np.stack([x, y, 0.02 * np.sin(9 * x)], axis=1)
    normals = np.stack([-0.18 * np.cos(9 * x), 0 * x, np.ones_like(x)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    vertices, faces, _ = poisson_reconstruction(points, normals, depth=7, open_at=np.ones(len(points), dtype=bool))
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edge, count = np.unique(edges, axis=0, return_counts=True)
    rim = edge[count == 1]
    # Each vertex of the border is shared by two of its edges: one closed line.
    assert set(np.unique(rim, return_counts=True)[1]) == {2}
    spacing = local_spacing(points).mean()
    along = vertices[np.unique(rim)]
    beside = along[(along[:, 1] > 0.1) & (along[:, 1] < 0.9) & (along[:, 0] > 0.5)]
    out = (beside[:, 0] - 1.0) / spacing
    assert abs(out.mean() - AUTO_DISTANCE) < 0.3
    assert np.ptp(out) < 0.5


def test_closed_bodies_stay_as_they_were():
    cut, whole = (reconstruct(BALL.points, depth=6, trim_distance=limit) for limit in ("auto", None))
    assert not cut.result.open.any()
    assert open_edges(cut.faces) == 0
    assert np.array_equal(cut.vertices, whole.vertices)
    assert np.array_equal(cut.faces, whole.faces)
    assert np.array_equal(cut.densities, whole.densities)


@pytest.mark.parametrize("execution", [None, pytest.param(TILES, marks=pytest.mark.slow)])
def test_a_body_over_a_floor_stays_whole_and_the_floor_is_cut(execution):
    points = ball_over_floor()
    opened = estimate_normals(points, execution=execution).open
    assert not opened[: len(BALL)].any()
    assert opened[len(BALL) :].all()
    surface = reconstruct(points, execution=execution, depth=7, up=(0, 0, 1))
    on_ball = (np.linalg.norm(surface.vertices, axis=1) < 1.2)[surface.faces].all(axis=1)
    assert open_edges(surface.faces[on_ball]) == 0
    assert on_ball.sum() > 1000
    assert open_edges(surface.faces[~on_ball]) > 0
    assert spacings(points, surface, 7)[0].max() < BENT * AUTO_DISTANCE


@pytest.mark.parametrize("execution", [None, TILES])
def test_what_is_inside_another_body_is_not_open(execution):
    """No field gets there, and what would tell its sides apart is rounding."""
    inner = shapes.sphere(1500, radius=0.6).points
    assert not estimate_normals(np.concatenate([BALL.points, inner]), execution=execution).open.any()


def test_half_a_sphere_is_left_open_where_a_distance_is_given():
    half = BALL.points[BALL.points[:, 2] > 0]
    surface = reconstruct(half, depth=6, trim_distance=2.0)
    assert open_edges(surface.faces) > 0
    away, back = spacings(half, surface, 6)
    assert away.max() < BENT * AUTO_DISTANCE
    assert (back < 1).mean() > 0.99
    # No bottom: the surface ends with the points.
    assert surface.vertices[:, 2].min() > -BENT * AUTO_DISTANCE * 0.08


def test_a_room_seen_from_inside_stays_closed_and_faces_inward():
    room = examples.load("room", 4000)
    surface = reconstruct(room.points, depth=7, viewpoints=room.viewpoints)
    assert not surface.result.open.any()
    assert open_edges(surface.faces) == 0


def test_pieces_without_points_go():
    """A far corner of the mesh that no point is near, and a scrap about two points."""
    flat = np.stack([*(axis.ravel() for axis in np.meshgrid(np.arange(9.0), np.arange(9.0))), np.zeros(81)], axis=1)
    points = np.concatenate([flat, [[40.0, 0, 0], [41.0, 0, 0]]])
    faces = np.array([[0, 1, 9], [1, 10, 9]])
    grid = (faces + (9 * np.arange(8)[:, None, None, None] + np.arange(8)[:, None, None])).reshape(-1, 3)
    scraps = np.array([[40.0, 0, 0], [41, 0, 0], [40, 1, 0], [90, 0, 0], [91, 0, 0], [90, 1, 0]])
    mesh = (np.concatenate([flat, scraps]), np.concatenate([grid, [[81, 82, 83], [84, 85, 86]]]), None)
    vertices, left, _ = trimmed_by_distance(mesh, points, 2.0)
    assert len(left) == len(grid)
    assert np.array_equal(vertices, flat)


@pytest.mark.parametrize("limit", [0, -1.0, float("nan"), float("inf"), True, "often", [2.0]])
def test_a_bad_limit_is_named(limit):
    with pytest.raises(ValueError, match="trim_distance must be a finite number > 0, 'auto' or None"):
        reconstruct(BALL.points, trim_distance=limit)


def test_open_at_must_fit():
    with pytest.raises(ValueError, match="open_at must be as many as points, found"):
        poisson_reconstruction(BALL.points, BALL.normals, depth=5, open_at=np.ones(3, dtype=bool))


@pytest.mark.parametrize("limit", ["auto", *(pytest.param(one, marks=pytest.mark.slow) for one in (1.5, None))])
def test_chains_cut_as_reconstruct_does(limit, tmp_path):
    chain = Chain([Normals(), Interior(), Reconstruct(depth=6, trim_distance=limit)])
    for path in (tmp_path / "chain.toml", tmp_path / "chain.json"):
        chain.save(path)
        assert Chain.load(path) == chain
    mesh = chain(PointSet(TERRAIN.points)).surface
    surface = reconstruct(TERRAIN.points, depth=6, trim_distance=limit)
    assert np.array_equal(mesh.vertices, surface.vertices)
    assert np.array_equal(mesh.faces, surface.faces)


def test_the_command_cuts(tmp_path):
    cloud = tmp_path / "terrain.ply"
    write_cloud(cloud, CloudFile(TERRAIN.points))
    area = {}
    for limit in ("auto", "1", "none"):
        assert (
            main(["mesh", str(cloud), "-o", str(tmp_path / "out.ply"), "--depth", "6", "--trim-distance", limit]) == 0
        )
        area[limit] = trimesh.load_mesh(tmp_path / "out.ply").area
    assert area["1"] < area["auto"] < area["none"]
