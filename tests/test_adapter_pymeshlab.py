"""The PyMeshLab filters with the real PyMeshLab: its conventions, and nothing else of a layer touched."""

import numpy as np
import pytest
from layers import NAMES, SHAPE, layer, ml

from face_plugin import Execution, Params, estimate_normals, reconstruct
from face_plugin.adapters import pymeshlab as face
from face_plugin.shapes import box, nested_box, torus

NESTED = nested_box(900)
ROOM = box(600)


def contents(mesh):
    """Read everything of a layer but its normals."""
    return {
        "id": mesh.id(),
        "label": mesh.label(),
        "visible": mesh.is_visible(),
        "matrix": mesh.transform_matrix().tolist(),
        "vertices": mesh.vertex_matrix().tolist(),
        "scalars": mesh.vertex_scalar_array().tolist(),
        "colours": mesh.vertex_color_matrix().tolist(),
        "selected": mesh.vertex_selection_array().tolist(),
        "attribute": mesh.vertex_custom_scalar_attribute_array("label").tolist(),
        "point attribute": mesh.vertex_custom_point_attribute_matrix("flow").tolist(),
    }


@pytest.mark.parametrize("turned", [False, True])
def test_normals_are_those_of_the_array_call_and_all_else_stays(turned):
    ms = layer(turned=turned)
    before = contents(ms.mesh(0))
    assert face.compute_normal_by_faraday_cage(ms) is None
    # In the layer's own coordinates, as MeshLab's filters: its matrix is applied for display only.
    assert np.array_equal(ms.mesh(0).vertex_normal_matrix(), estimate_normals(SHAPE.points).normals)
    assert contents(ms.mesh(0)) == before
    assert (ms.current_mesh_id(), ms.mesh_number()) == (0, 2)


def test_normals_can_be_written_again_and_again():
    ms = layer()
    for seed in (0, 1, 2):
        face.compute_normal_by_faraday_cage(ms, seed=seed)
        expected = estimate_normals(SHAPE.points, Params(seed=seed)).normals
        assert np.array_equal(ms.mesh(0).vertex_normal_matrix(), expected)


def test_only_the_selected_vertices_change_but_all_conduct():
    ms = layer()
    face.compute_normal_by_faraday_cage(ms, onselected=True)
    normals = ms.mesh(0).vertex_normal_matrix()
    assert np.array_equal(normals[:250], estimate_normals(SHAPE.points).normals[:250])
    assert not normals[250:].any()
    face.compute_scalar_by_faraday_strength(ms, onselected=True)
    scalars = ms.mesh(0).vertex_scalar_array()
    assert np.array_equal(scalars[:250], estimate_normals(SHAPE.points).strength[:250])
    assert np.array_equal(scalars[250:], np.arange(250, 600))


def test_settings_have_the_names_of_the_method_and_meshlabs_types():
    diagonal = float(np.linalg.norm(np.ptp(SHAPE.points, axis=0)))
    params = Params(cage_spacing=0.05 * diagonal, solid="icosahedron")
    expected = estimate_normals(SHAPE.points, params).normals
    for arguments in (
        {"cage_spacing": ml.PercentageValue(5), "solid": "icosahedron"},
        {"cage_spacing": ml.PureValue(0.05 * diagonal), "solid": 1},
    ):
        ms = layer()
        face.compute_normal_by_faraday_cage(ms, **arguments)
        # Percentage and diagonal round: 1e-12 is far above that, and far below what another setting changes.
        assert np.allclose(ms.mesh(0).vertex_normal_matrix(), expected, atol=1e-12)


def test_a_large_layer_is_solved_in_tiles():
    ms = ml.MeshSet()
    points = torus(2200).points
    ms.add_mesh(ml.Mesh(points))
    face.compute_normal_by_faraday_cage(ms, tile_points=1200, engine="serial")
    expected = estimate_normals(points, execution=Execution(tile_points=1200, engine="serial")).normals
    assert np.array_equal(ms.current_mesh().vertex_normal_matrix(), expected)
    assert not np.array_equal(expected, estimate_normals(points).normals)


def test_interior_points_are_selected_for_meshlab_to_delete():
    inside = estimate_normals(NESTED.points, Params(alpha=0.02), filter_interior=True).interior
    ms = layer(NESTED.points)
    before = contents(ms.mesh(0))
    face.compute_selection_by_faraday_interior(ms, alpha=0.02)
    assert np.array_equal(ms.mesh(0).vertex_selection_array(), inside)
    assert contents(ms.mesh(0)) == {**before, "selected": inside.tolist()}
    ms.meshing_remove_selected_vertices()
    assert np.array_equal(ms.current_mesh().vertex_matrix(), NESTED.points[~inside])


def test_field_strength_becomes_the_scalar():
    ms = layer()
    before = contents(ms.mesh(0))
    face.compute_scalar_by_faraday_strength(ms)
    strength = estimate_normals(SHAPE.points).strength
    assert contents(ms.mesh(0)) == {**before, "scalars": strength.tolist()}


def test_a_surface_is_a_new_current_layer_in_the_coordinates_of_the_scene():
    ms = layer(NESTED.points, turned=True)
    before = contents(ms.mesh(0))
    face.generate_surface_reconstruction_faraday(ms, depth=5)
    mesh = ms.current_mesh()
    assert (mesh.id(), mesh.label(), ms.mesh_number()) == (2, "Faraday mesh", 3)
    assert np.array_equal(mesh.transform_matrix(), np.eye(4))
    surface = reconstruct(ms.mesh(0).transformed_vertex_matrix(), depth=5, backend="pymeshlab")
    assert np.array_equal(mesh.vertex_matrix(), surface.vertices)
    assert np.array_equal(mesh.face_matrix(), surface.faces)
    assert contents(ms.mesh(0)) == before
    # MeshLab's own reconstruction makes the same of a layer's matrix.
    ms.set_current_mesh(0)
    face.compute_normal_by_faraday_cage(ms)
    ms.generate_surface_reconstruction_screened_poisson(depth=5, threads=1)
    host = ms.current_mesh()
    assert np.array_equal(host.transform_matrix(), np.eye(4))
    assert np.allclose(host.vertex_matrix().mean(axis=0), mesh.vertex_matrix().mean(axis=0), atol=0.05)


def test_attributes_with_the_names_of_ours_are_left_alone():
    ms = ml.MeshSet()
    ms.add_mesh(ml.Mesh(SHAPE.points))
    for number in range(200):
        ms.current_mesh().add_vertex_custom_scalar_attribute(np.full(600, float(number)), f"faraday_{number}")
    face.compute_normal_by_faraday_cage(ms)
    assert np.array_equal(ms.current_mesh().vertex_normal_matrix(), estimate_normals(SHAPE.points).normals)
    for number in range(200):
        values = ms.current_mesh().vertex_custom_scalar_attribute_array(f"faraday_{number}")
        assert np.array_equal(values, np.full(600, float(number)))


def test_attributes_of_ours_stay_out_of_files(tmp_path):
    ms = layer()
    face.compute_normal_by_faraday_cage(ms)
    ms.save_current_mesh(str(tmp_path / "scan.ply"))
    assert b"faraday" not in (tmp_path / "scan.ply").read_bytes()


def test_registered_filters_are_methods_and_known_by_name():
    originals = {name: ml.MeshSet.__dict__[name] for name in ("apply_filter", "apply_filter_script")}
    assert not any(hasattr(ml.MeshSet, name) for name in NAMES)
    face.register()
    face.register()
    try:
        ms = layer()
        assert ms.compute_normal_by_faraday_cage(seed=1) is None
        first = ms.mesh(0).vertex_normal_matrix()
        assert ms.apply_filter("compute_normal_by_faraday_cage", seed=2) == {}
        assert np.array_equal(first, estimate_normals(SHAPE.points, Params(seed=1)).normals)
        assert np.array_equal(ms.mesh(0).vertex_normal_matrix(), estimate_normals(SHAPE.points, Params(seed=2)).normals)
        assert ms.get_geometric_measures()["bbox"] is not None
        with pytest.raises(ml.PyMeshLabException, match="Filter does not exists"):
            ms.apply_filter("compute_normal_by_magic")
    finally:
        face.unregister()
        face.unregister()
    assert not any(hasattr(ml.MeshSet, name) for name in NAMES)
    assert {name: ml.MeshSet.__dict__[name] for name in originals} == originals


def test_a_viewpoint_has_the_names_of_meshlabs_own_filter():
    ms = ml.MeshSet()
    ms.add_mesh(ml.Mesh(ROOM.points))
    ms.compute_matrix_from_translation(axisx=5, freeze=False)
    inside = {"flipflag": True, "viewpos": np.array([0.1, 0.0, 0.0])}
    ms.compute_normal_for_point_clouds(**inside)
    face.compute_normal_by_faraday_cage(ms, alpha="auto", **inside)
    expected = estimate_normals(ROOM.points, viewpoints=[[0.1, 0.0, 0.0]]).normals
    assert np.array_equal(ms.current_mesh().vertex_normal_matrix(), expected)
    assert ((expected * ROOM.normals).sum(axis=1) < 0).all()
    # A position alone changes nothing, as there.
    face.compute_normal_by_faraday_cage(ms, viewpos=(0.1, 0.0, 0.0))
    assert np.array_equal(ms.current_mesh().vertex_normal_matrix(), estimate_normals(ROOM.points).normals)
    face.compute_selection_by_faraday_interior(ms, **inside)
    assert ms.current_mesh().selected_vertex_number() == 0
    # The reconstruction works in the scene, where the layer is moved.
    face.generate_surface_reconstruction_faraday(ms, depth=5, flipflag=True, viewpos=(5.1, 0.0, 0.0))
    corners = ms.current_mesh().vertex_matrix()[ms.current_mesh().face_matrix()] - [5.0, 0.0, 0.0]
    assert np.linalg.det(corners).sum() < 0


def test_a_viewpoint_survives_a_script(tmp_path):
    ms = ml.MeshSet()
    ms.add_mesh(ml.Mesh(ROOM.points))
    face.compute_normal_by_faraday_cage(ms, flipflag=True, viewpos=(0.1, 0.0, -0.2))
    expected = ms.current_mesh().vertex_normal_matrix()
    path = tmp_path / "script.mlx"
    ms.save_filter_script(str(path))
    again = ml.MeshSet()
    again.add_mesh(ml.Mesh(ROOM.points))
    face.run_filter_script(again, path)
    assert np.array_equal(again.current_mesh().vertex_normal_matrix(), expected)
    path.write_text(path.read_text().replace('x="0.1"', 'x="left"'), encoding="utf-8")
    with pytest.raises(ml.PyMeshLabException, match=r"step 1 .*parameter viewpos: 'left,0,-0.2' is no position"):
        face.run_filter_script(again, path)
