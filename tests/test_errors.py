import subprocess
import sys

import pytest

import face_plugin
from face_plugin import errors


def test_hierarchy():
    assert issubclass(errors.MissingDependencyError, (errors.FaceError, ImportError))
    assert issubclass(errors.MeshingError, errors.FaceError)
    assert issubclass(errors.MeshingError, RuntimeError)
    # What is wrong with the input is a ValueError and nothing else: callers tell the two apart.
    assert not issubclass(errors.FaceError, ValueError)


def test_require_returns_the_module():
    assert errors.require("xml.dom", extra="none") is sys.modules["xml.dom"]


def test_missing_package_names_the_extra_to_install():
    with pytest.raises(errors.MissingDependencyError, match=r"pip install 'face-plugin\[thing\]'") as caught:
        errors.require("a_package_of_no_name", extra="thing")
    assert caught.value.__cause__.name == "a_package_of_no_name"


@pytest.mark.parametrize(
    ("source", "error", "message"),
    [
        (
            "raise ImportError('libGL.so.1: cannot open shared object file')",
            errors.MissingDependencyError,
            "libGL.so.1",
        ),
        ("raise OSError('libfoo.so: not found')", errors.MissingDependencyError, "libfoo.so"),
        # A package that is installed but broken must not be reported as missing.
        ("import a_package_of_no_name", ModuleNotFoundError, "a_package_of_no_name"),
    ],
)
def test_package_that_cannot_be_loaded(tmp_path, monkeypatch, source, error, message):
    (tmp_path / "half_installed.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(error, match=message) as caught:
        errors.require("half_installed", extra="half")
    assert type(caught.value) is error


def test_import_loads_nothing_heavy():
    code = (
        "import sys, face_plugin;"
        "print(sorted(set(sys.modules) & {'numpy','numba','scipy','gmsh','open3d','pymeshlab'}))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_solving_loads_no_host():
    code = (
        "import sys, face_plugin, numpy as np;"
        "face_plugin.estimate_normals(np.random.default_rng(0).normal(size=(50, 3)));"
        "print(sorted(set(sys.modules) & {'open3d','pymeshlab','matplotlib','pyvista','trimesh'}))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_public_names():
    for name in face_plugin.__all__:
        assert getattr(face_plugin, name).__name__ == name
        assert name in dir(face_plugin)
    with pytest.raises(AttributeError, match=r"face_plugin.*nothing_of_that_name"):
        _ = face_plugin.nothing_of_that_name
