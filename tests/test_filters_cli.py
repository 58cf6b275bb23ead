"""`face chain`: a chain in a file, run on a file."""

import json

import numpy as np
import pytest

from face_plugin.app.cli import main
from face_plugin.filters import Chain, Interior, Normals, PointSet, Reconstruct, Thin
from face_plugin.io import CloudFile, read_cloud, write_cloud
from face_plugin.shapes import nested_box

SHAPE = nested_box(900)


@pytest.fixture
def files(tmp_path):
    write_cloud(tmp_path / "scan.ply", CloudFile(SHAPE.points, attributes={"label": np.arange(900)}))
    return tmp_path


def face_chain(files, chain, output, *options):
    chain.save(files / "chain.toml")
    paths = [str(files / "chain.toml"), str(files / "scan.ply"), "-o", str(files / output)]
    return main(["chain", *paths, *options])


def test_a_chain_of_points(files, capsys):
    chain = Chain([Thin(0.2), Normals(), Interior()])
    assert face_chain(files, chain, "out.ply", "--json") == 0
    layer = chain(PointSet(SHAPE.points))
    out = read_cloud(files / "out.ply")
    assert np.array_equal(out.points, SHAPE.points[layer.keep])
    assert np.allclose(out.normals, layer.normals[layer.keep], atol=1e-6)
    assert np.array_equal(out.attributes["label"], np.flatnonzero(layer.keep))
    summary = json.loads(capsys.readouterr().out)
    assert summary["kept"] == layer.keep.sum()
    assert summary["steps"] == chain.to_dict()["steps"]


def test_a_chain_that_ends_with_a_surface(files, capsys):
    chain = Chain([Normals(), Interior(), Reconstruct(depth=5)])
    assert face_chain(files, chain, "out.obj") == 0
    surface = chain(PointSet(SHAPE.points)).surface
    assert np.allclose(read_cloud(files / "out.obj").points, surface.vertices)
    assert f"{len(surface.faces):,} triangles" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("chain", "output", "message"),
    [
        (Chain([Normals(), Reconstruct()]), "out.las", "extension '.las'"),
        (Chain([Reconstruct()]), "out.ply", "step 1 (surface): a surface needs normals"),
    ],
)
def test_mistakes(files, capsys, chain, output, message):
    assert face_chain(files, chain, output, "--quiet") == 2
    assert message in capsys.readouterr().err
    assert not (files / output).exists()
