"""The front desk: one piece or tiles, and what is refused."""

import logging

import numpy as np
import pytest

from face_plugin import Execution, FaCE, MeshingError, Params, estimate_normals, shapes
from face_plugin.app.viewer.session import Session
from face_plugin.estimate import solve, solve_whole
from face_plugin.faraday import solve as solving
from face_plugin.filters import PointSet
from face_plugin.filters.sculpt import sculpted
from face_plugin.sculpt import SculptFile
from face_plugin.tiles import Tiled

BALL = shapes.sphere(1500, 0)
FIELD = Params(angles="field")
TILES = Execution(tile_points=1000, engine="serial")
# A tile of a thousand points fits, and 1500 in one piece do not.
LITTLE = Execution(max_memory=0.34, engine="serial")


def test_one_piece_or_tiles_by_the_number_of_points():
    assert isinstance(solve(BALL.points[:1000], FIELD, execution=TILES), FaCE)
    assert isinstance(solve(BALL.points, FIELD, execution=TILES), Tiled)
    assert isinstance(solve(BALL.points, execution=LITTLE), Tiled)


def test_what_needs_one_piece_is_refused_where_it_does_not_fit(tmp_path):
    file = tmp_path / "sculpt.json"
    SculptFile(charges=((0.0, 0.0, 0.0),)).save(file)
    refusal = r"points must be few enough for one piece, which .+ needs: 1500 take about 0.35 GB, found 0.34 GB"
    for call in (
        lambda: solve_whole(BALL.points, execution=LITTLE, purpose="a slice of the field"),
        lambda: estimate_normals(BALL.points, execution=LITTLE, sculpt=file),
        lambda: Session(BALL.points, execution=LITTLE),
        lambda: sculpted(PointSet(BALL.points), file, execution=LITTLE),
    ):
        with pytest.raises(ValueError, match=refusal):
            call()


def test_tiles_classify_when_asked_later():
    nested = shapes.nested_box(2000, 0)
    tiled = Tiled(nested.points, FIELD, execution=TILES)
    assert tiled.result().interior is None
    found = tiled.result(filter_interior=True).interior
    assert found is not None
    assert (found == nested.interior).mean() > 0.9
    np.testing.assert_array_equal(tiled.interior(), found)


def test_a_mesh_that_fails_is_tried_with_another_seed(monkeypatch, caplog):
    seeds = []
    build = solving.build_mesh

    def fails_once(balls, spacing, box, params, memory):
        seeds.append(params.seed)
        if len(seeds) == 1:
            raise MeshingError("no tetrahedra")
        return build(balls, spacing, box, params, memory)

    monkeypatch.setattr(solving, "build_mesh", fails_once)
    with caplog.at_level(logging.WARNING):
        result = estimate_normals(BALL.points[:500], Params(seed=7))
    assert seeds == [7, 8]
    assert "no tetrahedra; trying again with another seed" in caplog.text
    assert ((result.normals * BALL.normals[:500]).sum(axis=1) > 0).all()
    assert result.params.seed == 7


def test_a_mesh_that_always_fails_is_an_error(monkeypatch):
    def fails(*arguments):
        raise MeshingError("no tetrahedra")

    monkeypatch.setattr(solving, "build_mesh", fails)
    with pytest.raises(MeshingError, match="no tetrahedra"):
        FaCE(BALL.points[:200])
