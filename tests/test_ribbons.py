import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin.app.cli import main
from face_plugin.estimate import estimate_normals
from face_plugin.io import read_cloud, write_mesh
from face_plugin.ribbons import Samples, Stroke, normals_at_vertices, ribbons, sample, sparsify, teapot_sketch
from face_plugin.ribbons.generator import teapot_solids


def test_ribbons_sweep_the_brush():
    angle = np.linspace(0, np.pi, 200)
    arc = np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    sketch = ribbons([Stroke(arc, np.tile([0.0, 0.0, 1.0], (200, 1)), np.full(200, 0.2))])
    # A half annulus from radius 0.9 to 1.1.
    assert sketch.areas.sum() == pytest.approx(0.5 * np.pi * (1.1**2 - 0.9**2), rel=1e-3)
    radius = np.linalg.norm(sketch.vertices, axis=1).reshape(-1, 3)
    np.testing.assert_allclose(np.sort(radius, axis=1), np.tile([0.9, 1.0, 1.1], (200, 1)), atol=1e-3)


def test_sample_is_even_repeatable_and_on_the_ribbons():
    sketch = teapot_sketch()
    points = sample(sketch, 1500, seed=3)
    corners = sketch.vertices[sketch.faces[points.faces]]
    np.testing.assert_allclose(points.points, np.einsum("nk,nki->ni", points.barycentric, corners))
    np.testing.assert_allclose(points.barycentric.sum(axis=1), 1.0)
    assert points.barycentric.min() >= 0
    assert sample(sketch, 1500, seed=3).points.tobytes() == points.points.tobytes()
    assert not np.array_equal(sample(sketch, 1500, seed=4).points, points.points)
    nearest = cKDTree(points.points).query(points.points, k=2)[0][:, 1]
    # In space, where ribbons overlap too; measured 0.908 to 0.917 over ten seeds, uniform points have 0.03.
    assert nearest.min() > 0.85 * np.median(nearest)


def test_sample_by_spacing():
    sketch = teapot_sketch()
    points = sample(sketch, spacing=0.1).points
    assert cKDTree(points).query(points, k=2)[0][:, 1].min() > 0.1
    # Nothing is farther from a point than the spacing, but for what random candidates leave: measured over
    # ten seeds 0.112 to 0.128.
    assert cKDTree(points).query(sample(sketch, 5000, seed=99).points)[0].max() < 0.14


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 0}, "n: found 0"),
        ({"n": 5, "spacing": 1.0}, "found both"),
        ({"spacing": 0.0}, r"spacing: found 0.0"),
        ({"spacing": float("nan")}, "spacing: found nan"),
        ({"spacing": 1e-6}, "which asks for"),
    ],
)
def test_sample_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        sample(teapot_sketch(), **arguments)


def test_sparsify_removes_every_other_stroke():
    sketch = teapot_sketch()
    half = sparsify(sketch)
    # 36 of 64: each component keeps its first.
    assert 0.5 <= half.stroke_count / sketch.stroke_count < 0.6
    # Body rings are drawn first, one after the other: of those 0, 2, 4, ... stay.
    heights = [np.ptp(sketch.vertices[sketch.vertex_strokes == k][:, 2]) for k in (0, 2, 4)]
    left = [np.ptp(half.vertices[half.vertex_strokes == k][:, 2]) for k in (0, 1, 2)]
    np.testing.assert_allclose(left, heights)
    assert sparsify(sketch, keep=1.0).stroke_count == sketch.stroke_count
    quarter = sparsify(sketch, keep=0.25)
    assert quarter.stroke_count < half.stroke_count
    assert quarter.stations is not None
    for bad in (0.0, 1.5, "often"):
        with pytest.raises(ValueError, match="keep: found"):
            sparsify(sketch, keep=bad)


def test_select():
    sketch = teapot_sketch()
    part = sketch.select(np.array([2, 5]))
    assert part.stroke_count == 2
    np.testing.assert_array_equal(part.vertices[part.vertex_strokes == 1], sketch.vertices[sketch.vertex_strokes == 5])
    assert (part.vertex_strokes >= 0).all()
    with pytest.raises(ValueError, match="none selected"):
        sketch.select(np.array([], dtype=int))


def test_normals_at_vertices_weighs_by_barycentric():
    corners = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [9, 9, 9.0]])
    strip = ribbons([Stroke(corners[:2], np.tile([0.0, 0, 1], (2, 1)), np.ones(2))])
    plain = type(strip)(corners, np.array([[0, 1, 2]]), np.zeros(1, dtype=int))
    weights = np.array([[1.0, 0, 0], [0.5, 0.5, 0]])
    points = Samples(weights @ corners[:3], np.zeros(2, dtype=int), weights)
    normals = np.eye(3)[[0, 1]]
    out = normals_at_vertices(plain, points, normals)
    np.testing.assert_allclose(out[0], np.array([1, 0.5, 0]) / np.hypot(1, 0.5))
    np.testing.assert_allclose(out[1], [0, 1, 0])
    # No weight reaches these two: the nearest sample decides.
    np.testing.assert_allclose(out[2], [1, 0, 0])
    np.testing.assert_allclose(out[3], [0, 1, 0])
    with pytest.raises(ValueError, match="normals: found shape"):
        normals_at_vertices(plain, points, normals[:1])


def test_teapot_strokes_follow_their_solids():
    exact = teapot_sketch(tremor=0.0)
    level = np.min([np.abs(solid.level(exact.vertices[::3])) for solid in teapot_solids()], axis=0)
    assert level.max() < 1e-9
    # Legs, spout and both ends of the handle begin within the body.
    depth = np.min([solid.level(exact.vertices[::3]) for solid in teapot_solids()], axis=0)
    assert 0.1 < np.mean(depth < -0.05) < 0.4
    assert teapot_sketch(seed=1).vertices.tobytes() == teapot_sketch(seed=1).vertices.tobytes()
    for bad in ({"gap": 0.0}, {"overlap": -1.0}, {"tremor": -0.1}):
        with pytest.raises(ValueError, match=next(iter(bad))):
            teapot_sketch(**bad)


@pytest.mark.parametrize("sparse", [False, True], ids=["full", "every other stroke"])
def test_outward_normals_of_a_sketch(sparse):
    sketch = sparsify(teapot_sketch()) if sparse else teapot_sketch()
    points = sample(sketch, 2500)
    result = estimate_normals(points.points)
    solids = teapot_solids()
    drawn = [solid.sample(20_000, np.random.default_rng(0)) for solid in solids]
    surface, outward = (np.concatenate(parts) for parts in zip(*drawn, strict=True))

    def aligned(places, normals):
        outside = np.min([solid.level(places) for solid in solids], axis=0) > -0.03
        truth = outward[cKDTree(surface).query(places)[1]]
        return np.mean(np.einsum("ij,ij->i", normals, truth)[outside] > 0)

    # Measured over six seeds: points 0.9991 to 1.0, vertices 0.9952 to 0.9984, full and sparse alike.
    assert aligned(points.points, result.normals) > 0.995
    at_vertices = normals_at_vertices(sketch, points, result.normals)
    np.testing.assert_allclose(np.linalg.norm(at_vertices, axis=1), 1.0)
    assert aligned(sketch.vertices, at_vertices) > 0.985
    np.testing.assert_array_equal(at_vertices[0::3], at_vertices[1::3])


def test_command_makes_a_closed_mesh_without_dents(tmp_path, capsys):
    sketch = teapot_sketch()
    path, mesh, oriented = tmp_path / "in.ply", tmp_path / "out.ply", tmp_path / "oriented.ply"
    write_mesh(path, sketch.vertices, sketch.faces, normals=sketch.normals)
    arguments = [
        "ribbons",
        path,
        "-o",
        mesh,
        "--points",
        "4000",
        "--depth",
        "7",
        "--normals",
        oriented,
        "--json",
    ]
    assert main([str(argument) for argument in arguments]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["strokes"] == sketch.stroke_count
    assert summary["points"] == 4000
    cloud = read_cloud(mesh)
    vertices, faces = cloud.points, cloud.source["face"].data["vertex_indices"]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = (np.sort(a * np.int64(len(vertices)) + b) for a, b in (edges.T, edges.T[::-1]))
    np.testing.assert_array_equal(there, back)
    corners = vertices[faces].astype(float)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    # Body 2.83, and what handle, spout and legs add outside of it; measured 3.14 to 3.16.
    assert 3.0 < volume < 3.3
    level = np.min([solid.level(vertices) for solid in teapot_solids()], axis=0)
    # Unfiltered, the legs' ends inside the body leave dents and bubbles 0.59 deep. Filtered at alpha 0.01,
    # five drawings: up to 0.060 above the union, in the fillets of the joints, and 0.027 below it in four; in
    # the fifth (seed 3) three points at the spout stay and leave a dent of 0.146. At 0.02 none stay.
    assert level.min() > -0.06
    assert level.max() < 0.1
    normals = read_cloud(oriented).normals
    assert len(normals) == len(sketch.vertices)


def test_command_says_what_is_wrong(tmp_path, capsys):
    path = tmp_path / "in.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nl 1 2\n")
    output = tmp_path / "out.ply"
    assert main(["ribbons", str(path), "-o", str(output)]) == 2
    assert "width: the file has none" in capsys.readouterr().err
    assert main(["ribbons", str(path), "-o", str(output), "--points", "5", "--spacing", "1"]) == 2
    assert not output.exists()
