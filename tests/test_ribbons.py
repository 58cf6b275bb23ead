import json
import logging

import numpy as np
import pytest
from scipy.spatial import cKDTree

from face_plugin.cli import main
from face_plugin.io import read_cloud, write_mesh
from face_plugin.ribbons import (
    Samples,
    Stroke,
    normals_at_vertices,
    read_sketch,
    ribbons,
    sample,
    sparsify,
    teapot_sketch,
    write_normals,
)
from face_plugin.ribbons.generator import teapot_solids
from face_plugin.solver import estimate_normals

# Two strokes of four and three stations in the layout of SurfaceBrush, with colours that must survive.
HEADER = """ply
format ascii 1.0
comment two strokes
element vertex {vertices}
property float x
property float y
property float z
property float nx
property float ny
property float nz
property uchar red
element face {faces}
property list uchar int vertex_indices
end_header
"""


def station(x, y, up=1.0):
    return [f"{x} {y + d} 0 0 0 {up} 77" for d in (0.0, -0.25, 0.25)]


def quads(first, stations):
    starts = range(first, first + 3 * (stations - 1), 3)
    return [
        f"4 {c + a} {c + b} {c + e} {c + f}" for c in starts for a, b, e, f in ((0, 1, 4, 3), (0, 3, 5, 2))
    ]


def triples(tmp_path, vertices, faces, name="sketch.ply", counts=None):
    n, m = counts or (len(vertices), len(faces))
    path = tmp_path / name
    path.write_text(HEADER.format(vertices=n, faces=m) + "\n".join(vertices + faces) + "\n")
    return path


def two_strokes():
    vertices = [line for x in range(4) for line in station(x, 0.0)]
    vertices += [line for x in range(3) for line in station(x, 2.0, up=-1.0)]
    return vertices, quads(0, 4) + quads(12, 3)


@pytest.mark.parametrize("corners", ["vertex_indices", "vertex_index"])
def test_surfacebrush_layout(tmp_path, corners):
    path = triples(tmp_path, *two_strokes())
    path.write_text(path.read_text().replace("vertex_indices", corners))
    sketch = read_sketch(path)
    assert sketch.vertices.shape == (21, 3)
    assert sketch.faces.shape == (20, 3)
    assert sketch.stroke_count == 2
    np.testing.assert_array_equal(sketch.vertex_strokes, [0] * 12 + [1] * 9)
    np.testing.assert_array_equal(sketch.stations, np.arange(21) // 3)
    np.testing.assert_array_equal(sketch.normals[:, 2], [1.0] * 12 + [-1.0] * 9)
    assert sketch.areas.sum() == pytest.approx(3 * 0.5 + 2 * 0.5)
    assert sketch.problems == ()


def test_problems_are_reported_and_the_rest_is_read(tmp_path, caplog):
    vertices, faces = two_strokes()
    # Station 2 of the first stroke repeats station 1; then a station on its own, and a vertex too many.
    vertices[6:9] = vertices[3:6]
    vertices += [*station(9, 9), "7 7 7 0 0 1 77"]
    faces += ["4 0 1 99 3", "4 0 1 -2 3", "2 0 1"]
    with caplog.at_level(logging.WARNING, logger="face_plugin"):
        sketch = read_sketch(triples(tmp_path, vertices, faces))
    assert sketch.stroke_count == 2
    assert sketch.areas.sum() == pytest.approx(5 * 0.5)
    text = " / ".join(sketch.problems)
    assert "2 faces with an index outside of the 25 vertices" in text
    assert "1 faces of fewer than three corners" in text
    assert "4 triangles of no area" in text
    assert "4 vertices that no face refers to" in text
    assert all(problem in caplog.text for problem in sketch.problems)


def test_stroke_of_one_station(tmp_path):
    vertices, faces = two_strokes()
    sketch = read_sketch(triples(tmp_path, [*vertices, *station(9, 9)], faces))
    assert sketch.stroke_count == 2
    assert sketch.problems == ("left out 1 strokes of a single station, or stations that no face refers to",)


@pytest.mark.parametrize("cut", ["row", "line"])
def test_header_promises_too_many_faces(tmp_path, cut):
    vertices, faces = two_strokes()
    rows = faces[:-1] if cut == "row" else [*faces[:-1], "4 15 18"]
    sketch = read_sketch(triples(tmp_path, vertices, rows, counts=(21, len(faces))))
    assert len(sketch.faces) == 18
    assert sketch.problems[0] == "the header promises 10 rows of 'face', the file has 9"


def test_truncated_binary(tmp_path):
    whole = teapot_sketch()
    path = tmp_path / "whole.ply"
    write_mesh(path, whole.vertices, whole.faces, normals=whole.normals)
    cut = tmp_path / "cut.ply"
    cut.write_bytes(path.read_bytes()[: -13 * 1000 - 5])
    assert len(read_sketch(cut).faces) == len(whole.faces) - 1001


def test_file_ids_go_before_connectivity(tmp_path):
    path = tmp_path / "strip.ply"
    corners = np.array([[x, y, 0.0] for x in range(4) for y in (0, 1)])
    faces = np.array(
        [[2 * k, 2 * k + 2, 2 * k + 3] for k in range(3)] + [[2 * k, 2 * k + 3, 2 * k + 1] for k in range(3)]
    )
    write_mesh(path, corners, faces)
    assert read_sketch(path).stroke_count == 1
    write_mesh(path, corners, faces, attributes={"stroke": np.array([5, 5, 5, 5, 9, 9, 9, 9])})
    sketch = read_sketch(path)
    np.testing.assert_array_equal(sketch.strokes, [0, 0, 1, 0, 0, 1])
    assert sketch.stations is None


def test_obj_strips_and_groups(tmp_path):
    path = tmp_path / "strips.obj"
    strip = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv 2 0 0\nv 2 1 0\n"
    path.write_text(strip + "f 1 3 4 2\nf -4/1 -2/2 -1/3 -3/4\n")
    assert read_sketch(path).stroke_count == 1
    assert read_sketch(path).areas.sum() == pytest.approx(2.0)
    path.write_text(strip + "g one\nf 1 3 4 2\ng two\nf 3 5 6 4\n")
    assert read_sketch(path).stroke_count == 2


def test_soup_without_shared_vertices_is_welded(tmp_path):
    corners = np.array([[x, y, z] for z in (0, 5) for x in range(4) for y in (0, 1)], dtype=float)
    faces = np.array(
        [[z + 2 * k + j for j in t] for z in (0, 8) for k in range(3) for t in ((0, 2, 3), (0, 3, 1))]
    )
    path = tmp_path / "soup.ply"
    write_mesh(path, corners[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))
    assert read_sketch(path).stroke_count == 2


LINES = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\nl 1 2\nl 2 3\nl 4 5 6\n"
NORMALS = "vn 0 0 1\n" * 6


@pytest.mark.parametrize(
    ("text", "width", "area"),
    [
        (LINES + NORMALS, 0.5, 2.0),
        ("# stroke width: 0.25\n" + LINES + NORMALS, None, 1.0),
        ("# stroke width: 0.25\n" + LINES + NORMALS, 0.5, 2.0),
        (LINES.replace("l 4", "# width 0.1\nl 4").replace("l 1", "# width = 0.3\nl 1") + NORMALS, None, 0.8),
        (LINES.replace("0\nv", "0 0.2\nv").replace("2 1 0\nl", "2 1 0 0.2\nl") + NORMALS, None, 0.8),
        (LINES + NORMALS, None, 4.0),
        (LINES, None, 4.0),
    ],
    ids=[
        "argument",
        "comment",
        "argument first",
        "comment a stroke",
        "fourth number",
        "spacing",
        "no normals",
    ],
)
def test_obj_centre_lines(tmp_path, text, width, area):
    path = tmp_path / "strokes.obj"
    path.write_text(text)
    sketch = read_sketch(path, width=width)
    assert sketch.stroke_count == 2
    assert sketch.areas.sum() == pytest.approx(area)
    np.testing.assert_allclose(np.abs(sketch.normals[:, 2]), 1.0)
    np.testing.assert_allclose(sketch.vertices[::3], np.array([[x, y, 0] for y in (0, 1) for x in range(3)]))


def test_obj_centre_lines_with_problems(tmp_path):
    path = tmp_path / "strokes.obj"
    path.write_text(LINES + "v 2 1 0\nv 5 5 5\nv 6 6 6\nl 6 7\nl 8\nl 1 99\nl 0 1\n" + "vn 0 0 1\n" * 9)
    sketch = read_sketch(path, width=0.5)
    assert sketch.stroke_count == 2
    assert sketch.areas.sum() == pytest.approx(2.0)
    assert sketch.problems == (
        "left out 2 lines with an index outside of the 9 vertices",
        "left out 1 vertices that no line refers to",
        "left out 1 stations of zero length",
        "left out 1 strokes of a single station",
    )


def test_estimated_normals_follow_a_curved_drawing(tmp_path):
    # The body of the teapot as centre lines only: rings of latitude, all of one ellipsoid.
    whole = teapot_sketch(tremor=0.0)
    body = whole.select(np.arange(14))
    centres, count = body.vertices[::3], np.bincount(body.vertex_strokes[::3])
    first = np.cumsum(count) - count
    lines = [f"l {' '.join(str(k + 1) for k in range(a, a + c))}" for a, c in zip(first, count, strict=True)]
    path = tmp_path / "body.obj"
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in centres) + "\n".join(lines) + "\n")
    sketch = read_sketch(path)
    brush = body.normals[::3]
    cosine = np.abs(np.einsum("ij,ij->i", sketch.normals[::3], brush))
    # Measured: median 0.9995, 95 % above 0.985; the first and the last ring have neighbours on one side only.
    assert np.median(cosine) > 0.995
    assert np.mean(cosine > 0.95) > 0.9


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.stl", "", r"extension '.stl'; allowed are .ply, .obj"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "neither faces"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n", "width: the file has none"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 2\n", "no ribbon left: left out 1 triangles of no area"),
        ("a.obj", "v 0 0 0\nl 1 1\n", "no stroke of two or more stations|width"),
        ("a.ply", HEADER.format(vertices=3, faces=0) + "\n".join(station(0, 0)) + "\n", "no ribbon left"),
        ("a.ply", HEADER.format(vertices=6, faces=0) + "\n".join(station(0, 0)) + "\n", "early end-of-file"),
        ("a.ply", "ply\nnonsense\n", "not a readable PLY file"),
    ],
)
def test_unusable_files(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_sketch(path)


def test_bad_width(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(LINES)
    with pytest.raises(ValueError, match="width: found -1"):
        read_sketch(path, width=-1.0)


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
    # 64 strokes in seven or so components, each of which keeps its first.
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
    np.testing.assert_array_equal(
        part.vertices[part.vertex_strokes == 1], sketch.vertices[sketch.vertex_strokes == 5]
    )
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


def test_write_normals_keeps_the_file(tmp_path):
    path = triples(tmp_path, *two_strokes())
    sketch = read_sketch(path)
    out = tmp_path / "out.ply"
    write_normals(out, sketch, -sketch.normals)
    text = out.read_text()
    assert "comment two strokes" in text
    assert text.count("\n4 ") == 10
    cloud = read_cloud(out)
    np.testing.assert_array_equal(cloud.normals, -sketch.normals)
    np.testing.assert_array_equal(cloud.points, read_cloud(path).points)
    assert set(cloud.attributes["red"]) == {77}
    again = tmp_path / "out.obj"
    write_normals(again, sketch, sketch.normals)
    assert read_sketch(again).stroke_count == 2
    with pytest.raises(ValueError, match="normals: found shape"):
        write_normals(out, sketch, sketch.normals[:2])


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
    # Unfiltered, the legs' ends inside the body leave dents and bubbles 0.59 deep. Filtered at alpha 0.01, five
    # drawings: 0.052 to 0.060 above the union, in the fillets of the joints, and 0.014 to 0.027 below it in four;
    # in the fifth (seed 3) three points at the spout stay and leave a dent of 0.146. At 0.02 none stay.
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
