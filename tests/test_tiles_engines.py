"""Who solves the tiles: what engines do with a mesher that changes the process."""

import os

import pytest

from face_plugin.meshers.delaunay import tetrahedralize
from face_plugin.shapes import sphere


def test_gmsh_leaves_broken_pipes_to_python():
    """It sets SIGPIPE to kill the process, which a lost worker would then do to the one that waits for it."""
    tetrahedralize(sphere(200).points, "gmsh")
    read, write = os.pipe()
    os.close(read)
    with pytest.raises(BrokenPipeError):
        os.write(write, b"x")
    os.close(write)
