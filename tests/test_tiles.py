"""Tiles from end to end: the same answers as in one piece, whoever solves them and in whatever order."""

import dataclasses
import itertools
import os
import signal
import subprocess
import sys
import textwrap

import distributed
import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin import Execution, FaCE, Params, estimate_normals
from face_plugin.io.sources import ArraySource
from face_plugin.shapes import demo_shape, sphere
from face_plugin.tiles import estimate_tiled
from face_plugin.tiles.coarse import solve_coarse
from face_plugin.tiles.engines import Processes
from face_plugin.tiles.prepare import fill_store
from face_plugin.tiles.run import collect, solve_store
from face_plugin.tiles.scene import write_far
from face_plugin.tiles.surroundings import surroundings
from face_plugin.tiles.tile import HALO, orient_tile, solve_tile

EXECUTION = Execution(tile_points=1000, engine="serial")


@pytest.fixture(scope="module")
def shape():
    return demo_shape(4000)


@pytest.fixture(scope="module")
def serial(shape):
    return estimate_tiled(shape.points, execution=EXECUTION, filter_interior=True)


def same(a, b):
    return np.einsum("ij,ij->i", a, b) > 0


def equal(a, b):
    kinds = ("normals", "strength", "confidence", "interior")
    return all(np.array_equal(getattr(a, k), getattr(b, k)) for k in kinds)


def test_normals_of_one_piece(shape, serial):
    one = estimate_normals(shape.points, Params(), filter_interior=True)
    outside = ~shape.interior
    # Two seeds of the solve in one piece agree on 99.9 % of these, and are right on 99.8 %.
    assert same(one.normals, serial.normals)[outside].mean() > 0.996
    assert same(shape.normals, serial.normals)[outside].mean() > 0.996
    # The strength at a ball depends on the size of the tetrahedra, which the octree of each box fixes within
    # a factor of two only; measured here: 0.78 of that in one piece.
    visible = outside & (one.strength > 0.05)
    assert 0.6 < np.median(serial.strength[visible] / one.strength[visible]) < 1.6


def test_there_is_no_seam(shape, serial, tmp_path):
    """Where tiles meet, the normals are those of one piece as often as elsewhere."""
    one = estimate_normals(shape.points, Params())
    store, _ = fill_store(tmp_path, ArraySource(shape.points), Params(), 1000, interior=True)
    tile = np.empty(store.count, dtype=np.int64)
    tile[store.rows()] = np.repeat(np.arange(store.tiles), np.diff(store.start))
    distance, near = cKDTree(shape.points).query(shape.points, k=20)
    reach = 2 * distance[:, 1:7].mean(axis=1, keepdims=True)
    border = ((tile[near] != tile[:, None]) & (distance < reach)).any(axis=1)
    different = ~same(one.normals, serial.normals)
    at, elsewhere = different[border & ~shape.interior], different[~border & ~shape.interior]
    assert len(at) > 200
    # Measured: 0 of 589 at borders, 0 of 2079 elsewhere; another mesh may turn a few.
    assert at.mean() <= elsewhere.mean() + 3 / len(at)


def box_corners(around):
    return np.array(list(itertools.product(*zip(around.lower, around.upper, strict=True))))


@pytest.mark.slow
def test_interior_of_a_solid_larger_than_a_tile(tmp_path):
    """A ball in a ball, and tiles so small that some lie wholly inside, with nothing of the outside in their halo."""
    outer, inner = sphere(3000), sphere(2000, radius=0.3)
    source = ArraySource(np.concatenate([outer.points, inner.points]))
    store, voxels = fill_store(tmp_path, source, Params(), 80, interior=True)
    solve_coarse(voxels, store.params).save(tmp_path)
    store.save()
    for tile in range(store.tiles):
        solve_tile(str(tmp_path), tile)
    write_far(store)
    for tile in range(store.tiles):
        orient_tile(str(tmp_path), tile)
    found = collect(store)
    inside = np.arange(source.count) >= 3000
    assert found["interior"][inside].all()
    assert not found["interior"][~inside].any()
    assert same(found["normals"][~inside], outer.normals).all()
    # That there are such tiles: the farthest corner of the box that one sees.
    corners = [store.frame.from_unit(box_corners(surroundings(store, tile, HALO))) for tile in range(store.tiles)]
    assert min(np.linalg.norm(c, axis=1).max() for c in corners) < 0.9


@pytest.mark.parametrize("alpha", ["auto", "dense", 0.05])
def test_interior_as_in_one_piece(shape, alpha):
    tiles = Execution(tile_points=2000, engine="serial")
    tiled = estimate_tiled(shape.points, Params(alpha=alpha), filter_interior=True, execution=tiles).interior
    one = FaCE(shape.points, Params(alpha=alpha)).interior()
    # Measured: 99.5 % for every alpha; what differs lies at the seams of the parts.
    assert (tiled == one).mean() > 0.985
    assert (tiled == shape.interior).mean() > (one == shape.interior).mean() - 0.015


def test_a_flat_cloud_has_one_normal():
    rng = np.random.default_rng(0)
    points = np.c_[rng.random((2500, 2)), np.zeros(2500)]
    tiled = estimate_tiled(points, execution=Execution(tile_points=1250, engine="serial"))
    assert np.array_equal(tiled.normals, FaCE(points).normals())


def test_plain_gradients(shape):
    tiled = estimate_tiled(shape.points, Params(angles="field"), execution=Execution(tile_points=2000, engine="serial"))
    one = estimate_normals(shape.points, Params(angles="field"))
    assert same(tiled.normals, one.normals)[~shape.interior].mean() > 0.998


class Killing(Processes):
    """Processes, one of which is killed in the middle."""

    killed = 0

    def run(self, job, folder, tiles, done):
        def and_kill(tile):
            done(tile)
            if not self.killed:
                self.killed = next(iter(self._pool._processes))
                os.kill(self.killed, signal.SIGKILL)

        super().run(job, folder, tiles, and_kill)


def test_a_killed_process_changes_nothing(shape, serial):
    engine = Killing(2)
    result = estimate_tiled(shape.points, filter_interior=True, execution=dataclasses.replace(EXECUTION, engine=engine))
    assert engine.killed
    assert equal(result, serial)


def test_a_script_needs_no_main_guard(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent(
            """
            print("started")
            from face_plugin import Execution, estimate_normals
            from face_plugin.shapes import sphere
            ball = sphere(2500)
            result = estimate_normals(ball.points, execution=Execution(tile_points=1250, engine="processes", workers=2))
            print(((result.normals * ball.normals).sum(axis=1) > 0).mean())
            """
        )
    )
    out = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["started", "1.0"]


@pytest.mark.slow
def test_dask_with_a_worker_killed(shape, serial):
    killed = []
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())

        def kill(stage, fraction):
            if stage == "tiles" and fraction > 0 and not killed:
                killed.append(fraction)
                os.kill(pids[0], signal.SIGKILL)

        result = estimate_tiled(
            shape.points,
            filter_interior=True,
            execution=dataclasses.replace(EXECUTION, engine=client),
            progress=kill,
        )
        assert killed
        assert killed[0] < 1
        assert equal(result, serial)
        # The address of a scheduler will do as well, in the settings: that is how a host passes it.
        small = sphere(2500).points
        by_address = estimate_normals(small, execution=Execution(tile_points=1250, engine=cluster.scheduler_address))
        assert equal(by_address, estimate_normals(small, execution=Execution(tile_points=1250, engine="serial")))


def test_the_order_of_the_points_does_not_matter(shape, serial):
    order = np.random.default_rng(0).permutation(len(shape.points))
    result = estimate_tiled(shape.points[order], execution=EXECUTION, filter_interior=True)
    for kind in ("normals", "strength", "confidence"):
        assert np.allclose(getattr(result, kind), getattr(serial, kind)[order], rtol=0, atol=1e-6)
    assert np.array_equal(result.interior, serial.interior[order])


def test_input_types_and_repeated_points():
    ball = sphere(2000)
    points = ball.points[np.r_[0:2000, 0:500]].astype(np.float32)
    result = estimate_tiled(points, execution=Execution(tile_points=1250, engine="serial"))
    assert result.normals.dtype == np.float32
    assert np.array_equal(result.normals[:500], result.normals[2000:])
    assert same(result.normals[:2000], ball.normals).all()
    whole = np.rint(ball.points * 1000).astype(int)
    assert same(
        estimate_tiled(whole, execution=Execution(tile_points=1000, engine="serial")).normals, ball.normals
    ).all()


def test_a_tile_of_copies_of_one_stray_point():
    ball = sphere(1200)
    points = np.r_[ball.points, np.full((1100, 3), 4.0)]
    result = estimate_tiled(points, execution=Execution(tile_points=1000, engine="serial"))
    assert same(result.normals[:1200], ball.normals).mean() > 0.99
    assert np.isfinite(result.normals).all()
    assert np.allclose(np.linalg.norm(result.normals, axis=1), 1.0)


def test_a_dense_patch_beside_a_sparse_rest():
    """Spacings that differ by ten next to each other, as where a scanner came near."""
    ball = sphere(3000)
    rng = np.random.default_rng(0)
    dense = rng.normal(scale=0.1, size=(4000, 3))
    dense[:, 2] = np.sqrt(1 - dense[:, 0] ** 2 - dense[:, 1] ** 2)
    points = np.concatenate([ball.points, dense])
    result = estimate_tiled(points, execution=Execution(tile_points=1500, engine="serial"))
    # Uniform random points leave pairs that nearly touch; in one piece 99.9 % are right as well.
    assert same(result.normals, points).mean() > 0.995


def test_progress_counts_the_tiles():
    seen = []
    estimate_tiled(sphere(3000).points, execution=EXECUTION, progress=lambda stage, done: seen.append((stage, done)))
    tiles = [done for stage, done in seen if stage == "tiles"]
    assert tiles == sorted(tiles)
    assert len(set(tiles)) == 4
    for stage in ("cloud", "coarse", "tiles", "normals"):
        assert (stage, 0.0) in seen
        assert (stage, 1.0) in seen


def test_a_tile_done_is_not_solved_again(tmp_path, monkeypatch):
    source = ArraySource(sphere(2500).points)
    store, _ = solve_store(tmp_path, source, Params(), execution=Execution(tile_points=1250, engine="serial"))
    before = store.path(0, "field").stat().st_mtime_ns
    assert solve_tile(str(tmp_path), 0) == 0
    assert store.path(0, "field").stat().st_mtime_ns == before


def test_what_is_inside_a_solid_is_found_in_tiles():
    """Parts that cross, and a box, in a body that no tile sees in full."""
    body = demo_shape(20000, 2)
    execution = Execution(tile_points=8000, engine="serial")
    found = estimate_normals(body.points, filter_interior=True, execution=execution).interior
    assert found[body.interior].mean() > 0.95
    assert found[~body.interior].mean() < 0.002
