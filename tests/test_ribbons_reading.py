import logging

import numpy as np
import pytest

from face_plugin.io import read_cloud, write_mesh
from face_plugin.ribbons import read_sketch, teapot_sketch, write_normals

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
    return [f"4 {c + a} {c + b} {c + e} {c + f}" for c in starts for a, b, e, f in ((0, 1, 4, 3), (0, 3, 5, 2))]


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
    faces = np.array([[z + 2 * k + j for j in t] for z in (0, 8) for k in range(3) for t in ((0, 2, 3), (0, 3, 1))])
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


def test_obj_stations_that_are_not_finite(tmp_path):
    path = tmp_path / "strokes.obj"
    path.write_text(LINES.replace("v 1 0 0", "v nan 0 0") + "v inf 0 0\n")
    sketch = read_sketch(path, width=0.5)
    # The first stroke goes on past its lost station.
    assert sketch.stroke_count == 2
    assert sketch.areas.sum() == pytest.approx(2.0)
    assert "left out 1 stations whose position is not finite" in sketch.problems


def test_comment_that_talks_of_width(tmp_path):
    path = tmp_path / "strokes.obj"
    for words in ("the width: even", "width 1..2", "width 0.2.1", "width -"):
        path.write_text(f"# {words}\n" + LINES + NORMALS)
        assert read_sketch(path).areas.sum() == pytest.approx(4.0)  # the spacing, as without it


def test_strips_of_ply(tmp_path):
    path = tmp_path / "strips.ply"
    header = HEADER.format(vertices=10, faces=0).replace(
        "end_header", "element tristrips 1\nproperty list int int vertex_indices\nend_header"
    )
    vertices = [f"{x} {y} {z} 0 0 1 77" for z, count in ((0, 3), (1, 2)) for x in range(count) for y in (0, 1)]
    path.write_text(header + "\n".join(vertices) + "\n11 0 1 2 3 4 5 -1 6 7 8 9\n")
    sketch = read_sketch(path)
    assert sketch.stroke_count == 2
    assert sketch.areas.sum() == pytest.approx(3.0)
    a, b, c = (sketch.vertices[sketch.faces[:, k]] for k in range(3))
    assert len(np.unique(np.sign(np.cross(b - a, c - a)[:, 2]))) == 1  # all turned alike
    for row in ("3 0 -1 1", "4 0 0 1 1"):
        path.write_text(header + "\n".join(vertices) + f"\n{row}\n")
        with pytest.raises(ValueError, match=r"strips.ply: the sketch has no ribbon left"):
            read_sketch(path)


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
    # Measured: median 0.99997, the lowest 5 % at 0.998, none below 0.95; the outer rings have neighbours on
    # one side only.
    assert np.median(cosine) > 0.999
    assert cosine.min() > 0.95


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
    with pytest.raises(ValueError, match=message) as caught:
        read_sketch(path)
    assert name in str(caught.value)


def test_bad_width(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(LINES)
    with pytest.raises(ValueError, match="width: found -1"):
        read_sketch(path, width=-1.0)


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
