"""Filter scripts in which our filters stand between MeshLab's own."""

import numpy as np
import pytest

from face_plugin import Params, estimate_normals
from face_plugin.adapters import pymeshlab as face
from face_plugin.app.cli import main
from face_plugin.shapes import nested_box, torus

ml = pytest.importorskip("pymeshlab")

SHAPE = torus(600)
HEAD = "<!DOCTYPE FilterScript>\n<FilterScript>\n"
TAIL = "</FilterScript>\n"
TRANSLATE = (
    ' <filter name="Transform: Translate, Center, set Origin">\n'
    '  <Param type="RichDynamicFloat" name="axisX" value="2.5" description="" tooltip="" min="-9" max="9"/>\n'
    " </filter>\n"
)
NORMALS = (
    ' <filter name="Compute Normal by Faraday Cage">\n'
    '  <Param type="RichInt" name="seed" value="4" description="" tooltip=""/>\n'
    '  <Param type="RichEnum" name="solid" value="1" description="" tooltip=""'
    ' enum_cardinality="2" enum_val0="octahedron" enum_val1="icosahedron"/>\n'
    " </filter>\n"
)
FLIP = ' <filter name="Per Vertex Normal Function"/>\n'


def scan(points=SHAPE.points):
    ms = ml.MeshSet()
    ms.add_mesh(ml.Mesh(points), "scan")
    return ms


def script(tmp_path, *steps):
    path = tmp_path / "script.mlx"
    path.write_text(HEAD + "".join(steps) + TAIL, encoding="utf-8")
    return path


def saved(ms, tmp_path):
    ms.save_filter_script(str(tmp_path / "saved.mlx"))
    return (tmp_path / "saved.mlx").read_text(encoding="utf-8")


def test_our_step_runs_in_its_place(tmp_path):
    ms = scan()
    face.run_filter_script(ms, script(tmp_path, TRANSLATE, NORMALS, FLIP))
    moved = SHAPE.points + np.array([2.5, 0, 0])
    expected = estimate_normals(moved, Params(seed=4, solid="icosahedron")).normals
    # MeshLab's function, by default, turns round the normals that it finds: those of our step.
    assert np.array_equal(ms.current_mesh().vertex_normal_matrix(), -expected)
    assert np.array_equal(ms.current_mesh().vertex_matrix(), moved)


def test_a_script_without_our_steps_gives_bit_for_bit_what_pymeshlab_gives(tmp_path):
    source = scan()
    source.compute_normal_for_point_clouds(k=12, smoothiter=1, viewpos=[0.1, 0.2, 1 / 3])
    source.compute_matrix_from_rotation(angle=33.3, rotaxis="X axis", freeze=True)
    source.generate_surface_reconstruction_screened_poisson(depth=5, threads=1)
    source.apply_coord_laplacian_smoothing()
    source.meshing_decimation_quadric_edge_collapse(targetfacenum=1000)
    # Not a sampling filter: MeshLab's random numbers go on from call to call.
    source.generate_convex_hull()
    source.save_filter_script(str(tmp_path / "host.mlx"))
    host, ours = scan(), scan()
    host.load_filter_script(str(tmp_path / "host.mlx"))
    host.apply_filter_script()
    face.run_filter_script(ours, tmp_path / "host.mlx")
    assert ours.mesh_number() == host.mesh_number() == 3
    for number in range(3):
        a, b = host.mesh(number), ours.mesh(number)
        assert np.array_equal(a.vertex_matrix(), b.vertex_matrix())
        assert np.array_equal(a.face_matrix(), b.face_matrix())
        assert np.array_equal(a.vertex_normal_matrix(), b.vertex_normal_matrix())
        assert a.label() == b.label()
    assert host.current_mesh_id() == ours.current_mesh_id()
    assert saved(host, tmp_path) == saved(ours, tmp_path)


def test_our_steps_are_saved_among_meshlabs_and_give_the_same_again(tmp_path):
    ms = scan()
    ms.compute_matrix_from_translation(axisx=2.5)
    face.compute_normal_by_faraday_cage(ms, cage_spacing=ml.PercentageValue(5), solid="icosahedron", seed=3)
    ms.compute_normal_by_function_per_vertex()
    face.compute_selection_by_faraday_interior(ms, alpha=0.0125)
    face.generate_surface_reconstruction_faraday(ms, depth=5, screened=False)
    text = saved(ms, tmp_path)
    names = [line.split('"')[1] for line in text.splitlines() if "<filter" in line]
    assert names == [
        "Transform: Translate, Center, set Origin",
        "Compute Normal by Faraday Cage",
        "Per Vertex Normal Function",
        "Compute Selection by Faraday Interior",
        "Generate Surface Reconstruction Faraday",
    ]
    assert "faraday_" not in text  # the attributes that values are written through are nobody else's business
    assert 'enum_val1="icosahedron"' in text
    again = scan()
    face.run_filter_script(again, tmp_path / "saved.mlx")
    # The script holds six digits, as MeshLab writes them, of the spacing.
    assert np.allclose(ms.mesh(0).vertex_normal_matrix(), again.mesh(0).vertex_normal_matrix(), atol=1e-4)
    assert ms.mesh(1).face_number() == again.mesh(1).face_number()
    assert np.array_equal(ms.mesh(0).vertex_selection_array(), again.mesh(0).vertex_selection_array())
    assert saved(again, tmp_path) == text


def test_a_filter_that_fails_is_not_recorded(tmp_path):
    ms = scan()
    ms.compute_matrix_from_translation(axisx=2.5)
    with pytest.raises(ml.PyMeshLabException):
        face.compute_normal_by_faraday_cage(ms, alpha=7.0)
    assert saved(ms, tmp_path).count("<filter") == 1


def test_pymeshlab_runs_our_steps_once_they_are_registered(tmp_path):
    ms = scan()
    ms.load_filter_script(str(script(tmp_path, TRANSLATE, NORMALS)))
    with pytest.raises(ml.PyMeshLabException):
        ms.apply_filter_script()
    face.register()
    try:
        for steps in ((TRANSLATE, NORMALS), (FLIP,)):
            ours, expected = scan(), scan()
            path = script(tmp_path, *steps)
            ours.load_filter_script(str(path))
            ours.apply_filter_script()
            face.run_filter_script(expected, path)
            assert np.array_equal(
                ours.current_mesh().vertex_normal_matrix(), expected.current_mesh().vertex_normal_matrix()
            )
            assert saved(ours, tmp_path) == saved(expected, tmp_path)
    finally:
        face.unregister()


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (' <filter name="Poisson-disk Sampling"/>\n', r"step 2 \(Poisson-disk Sampling\): Failed to "),
        (' <filter name="No Such Filter"/>\n', r"step 2 \(No Such Filter\): "),
        (NORMALS.replace("seed", "sead"), r"step 2 \(Compute Normal by .*\): unknown parameter 'sead'"),
        (NORMALS.replace('"4"', '"four"'), "parameter seed: 'four' is no int"),
        (NORMALS.replace('"solid" value="1"', '"solid" value="9"'), "parameter solid: '9' is no enum"),
        (NORMALS.replace('"solid" value="1"', '"solid" value="-1"'), "parameter solid: '-1' is no enum"),
        (NORMALS.replace("RichInt", "RichBool").replace("seed", "onselected"), "onselected: '4' is no bool"),
        (NORMALS.replace('"4"', '"-4"'), r"step 2 .*: Failed to apply filter: compute_(.|\n)*seed must"),
    ],
)
def test_errors_name_the_step_and_the_script_stays_loaded(tmp_path, bad, message):
    ms = scan()
    with pytest.raises(ml.PyMeshLabException, match=message):
        face.run_filter_script(ms, script(tmp_path, TRANSLATE, bad, FLIP))
    # What ran before stands, what comes after did not run, as in MeshLab.
    assert np.allclose(ms.current_mesh().vertex_matrix()[:, 0], SHAPE.points[:, 0] + 2.5)
    assert not ms.current_mesh().vertex_normal_matrix().any()
    assert saved(ms, tmp_path).count("<filter") == 3


@pytest.mark.parametrize("text", ["", "no XML", "<FilterScript>", "<Project/>"])
def test_files_that_are_no_scripts(tmp_path, text):
    path = tmp_path / "script.mlx"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="not a MeshLab filter script") as caught:
        face.run_filter_script(scan(), path)
    assert str(path) in str(caught.value)


def test_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        face.run_filter_script(scan(), tmp_path / "none.mlx")


def test_what_meshlab_prints_while_it_reads_scripts_stays_off_stderr(tmp_path, capfd):
    face.run_filter_script(scan(), script(tmp_path, TRANSLATE, NORMALS))
    assert "Reading filter" not in capfd.readouterr().err


def test_the_command_line_runs_a_script(tmp_path, capsys):
    shape = nested_box(900)
    ms = scan(shape.points)
    ms.save_current_mesh(str(tmp_path / "scan.ply"))
    delete = ' <filter name="Delete Selected Vertices"/>\n'
    path = script(tmp_path, ' <filter name="Compute Selection by Faraday Interior"/>\n', delete, NORMALS)
    source, target = str(tmp_path / "scan.ply"), str(tmp_path / "out.ply")
    assert main(["script", source, str(path), "-o", target, "--json"]) == 0
    out = ml.MeshSet()
    out.load_new_mesh(str(tmp_path / "out.ply"))
    points = shape.points.astype(np.float32).astype(np.float64)  # as the file holds them
    inside = estimate_normals(points, filter_interior=True).interior
    assert out.current_mesh().vertex_number() == (~inside).sum()
    assert f'"vertices": {(~inside).sum()}' in capsys.readouterr().out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.ply", "scan.ply", "script.mlx"]


@pytest.mark.parametrize(
    ("source", "steps", "target", "code"),
    [
        ("none.ply", NORMALS, "out.ply", 2),
        ("scan.ply", NORMALS, "out.abc", 2),
        ("scan.ply", NORMALS, "none/out.ply", 2),
        ("scan.ply", ' <filter name="Poisson-disk Sampling"/>\n', "out.ply", 1),
    ],
)
def test_the_command_line_says_what_is_wrong(tmp_path, capsys, source, steps, target, code):
    scan().save_current_mesh(str(tmp_path / "scan.ply"))
    path = str(script(tmp_path, steps))
    assert main(["script", str(tmp_path / source), path, "-o", str(tmp_path / target), "--quiet"]) == code
    assert "face: error:" in capsys.readouterr().err
    assert not (tmp_path / target).exists()


@pytest.mark.parametrize("title", ["NXS Build", "Export to Sketchfab", "Export active rasters cameras to file"])
def test_a_script_may_not_write_files_of_its_own(tmp_path, title):
    path = script(tmp_path, NORMALS, f' <filter name="{title}"/>\n')
    before = sorted(tmp_path.iterdir())
    with pytest.raises(ValueError, match=rf"script.mlx: step 2 \({title}\) writes or sends files"):
        face.run_filter_script(scan(), path)
    assert sorted(tmp_path.iterdir()) == before


TEXTURE = (
    ' <filter name="Parametrization: Trivial Per-Triangle">\n'
    '  <Param type="RichInt" name="textdim" value="64" description="" tooltip=""/>\n'
    " </filter>\n"
    ' <filter name="Transfer: Vertex Attributes to Texture (1 or 2 meshes)">\n'
    '  <Param type="RichEnum" name="AttributeEnum" value="1" description="" tooltip=""'
    ' enum_cardinality="4" enum_val0="a" enum_val1="b" enum_val2="c" enum_val3="d"/>\n'
    '  <Param type="RichString" name="textName" value="{}" description="" tooltip=""/>\n'
    '  <Param type="RichInt" name="textW" value="64" description="" tooltip=""/>\n'
    '  <Param type="RichInt" name="textH" value="64" description="" tooltip=""/>\n'
    " </filter>\n"
)


@pytest.mark.parametrize("name", ["../../outside.png", "inside.png"])
def test_a_texture_stays_in_the_folder_of_the_output(tmp_path, capsys, name):
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    ms = ml.MeshSet()
    ms.create_cube()
    ms.save_current_mesh(str(folder / "in.ply"))
    path = script(folder, TEXTURE.format(name))
    code = main(["script", str(folder / "in.ply"), str(path), "-o", str(folder / "out.obj")])
    found = {str(entry.relative_to(tmp_path)) for entry in tmp_path.rglob("*") if entry.is_file()}
    made = found - {"a/b/in.ply", "a/b/script.mlx"}
    if name == "inside.png":
        assert code == 0
        assert made == {"a/b/out.obj", "a/b/out.obj.mtl", "a/b/inside.png"}
    else:
        assert code == 2
        assert "outside.png' would leave the folder" in capsys.readouterr().err
        assert not made
