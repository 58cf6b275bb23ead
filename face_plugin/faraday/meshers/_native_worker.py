"""The process in which TetGen and fTetWild run: ``python -m (this module) LIBRARY IN OUT BYTES``.

Arrays come and go as .npz files. Imports no more than NumPy, the library and `face_plugin.child`.
"""

from __future__ import annotations

import importlib
import sys
from typing import Any

import numpy as np

from face_plugin.child import limit_memory

Arrays = dict[str, Any]


def tetgen(data: Arrays) -> Arrays:
    """Constrained quality mesh of facets with markers, holes and a limit on the volume of a tetrahedron."""
    mesher: Any = importlib.import_module("tetgen").TetGen(data["vertices"], data["faces"], data["markers"])
    for hole in data["holes"]:
        mesher.add_hole(hole)
    vertices, tets, _, markers = mesher.tetrahedralize(switches=str(data["switches"]))
    return {"vertices": vertices, "tets": tets, "faces": mesher.trifaces, "markers": markers}


def tetwild(data: Arrays) -> Arrays:
    """Mesh of the space that a triangle soup encloses by its winding number."""
    mesher: Any = importlib.import_module("pytetwild")
    vertices, tets = mesher.tetrahedralize(
        data["vertices"],
        data["faces"],
        edge_length_fac=float(data["edge_length"]),
        epsilon=float(data["envelope"]),
        optimize=bool(data["optimize"]),
        simplify=False,
        num_threads=1,
        quiet=True,
    )
    return {"vertices": vertices, "tets": tets}


LIBRARIES = {"tetgen": ("tetgen", tetgen), "tetwild": ("pytetwild", tetwild)}


def main() -> None:
    """Read, mesh, write; an exception ends the process, and its last line tells the caller why."""
    name, given, made, size = sys.argv[1:]
    module, function = LIBRARIES[name]
    importlib.import_module(module)
    with np.load(given) as archive:
        data = dict(archive)
    limit_memory(int(size))
    np.savez(made, **function(data))


if __name__ == "__main__":
    main()
