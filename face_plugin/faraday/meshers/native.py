"""Run the libraries that may abort the process in a process of their own.

TetGen and fTetWild end the process they run in on some inputs (failed assertions, exceptions thrown through
C, exhausted memory). A user's session must survive that, so `face_plugin.faraday.meshers._native_worker` calls them.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from face_plugin.child import environment, failure
from face_plugin.errors import MeshingError
from face_plugin.faraday.domain import Box
from face_plugin.faraday.meshers.boundary import Boundary, snapped_to_box

__all__ = ["native_mesh", "run_native"]


def native_mesh(
    library: str, surface: Boundary, box: Box, settings: dict[str, NDArray[np.generic]], *, memory: float, advice: str
) -> tuple[dict[str, NDArray[np.generic]], NDArray[np.float64], NDArray[np.bool_]]:
    """Mesh what triangles bound.

    Parameters
    ----------
    library, memory, advice
        As of `run_native`.
    surface : Boundary
    box : Box
        That it bounds from outside.
    settings : dict of arrays
        What the worker's function takes beside the triangles.

    Returns
    -------
    made : dict of arrays
        What the library gave.
    vertices : (m, 3) float64
        Those of it, on the box's own planes where they are on the box.
    boundary : (m,) bool
        Whether they are.

    Raises
    ------
    MeshingError
        As of `run_native`; or there are no tetrahedra.
    """
    arrays: dict[str, NDArray[np.generic]] = {"vertices": surface.vertices, "faces": surface.faces, **settings}
    made = run_native(library, arrays, memory=memory, advice=advice)
    if len(made["tets"]) == 0:
        raise MeshingError(f"{library} made no tetrahedra; {advice}")
    return made, *snapped_to_box(made["vertices"].astype(np.float64), box)


def run_native(
    library: str, arrays: dict[str, NDArray[np.generic]], *, memory: float, advice: str
) -> dict[str, NDArray[np.generic]]:
    """Run a native mesher on arrays in a new process and return the arrays that it gives.

    Works from any script, guarded by ``if __name__ == "__main__"`` or not: the child imports nothing of the
    caller's.

    Parameters
    ----------
    library : {"tetgen", "tetwild"}
    arrays : dict of arrays
        What the worker's function of that name takes.
    memory : float
        Bytes that the child may allocate; held where the system allows it (not on Windows and macOS).
    advice : str
        What to try after a failure; goes into the exception.

    Raises
    ------
    MeshingError
        The child crashed, ran out of memory, or the library refused the input.
    """
    if not sys.executable:
        raise MeshingError(f"{library} runs in a process of its own, and this program names no Python interpreter")
    with tempfile.TemporaryDirectory(prefix="face-plugin-") as folder:
        given, made = Path(folder, "in.npz"), Path(folder, "out.npz")
        np.savez(given, **arrays)  # type: ignore[arg-type]
        command = [sys.executable, "-m", "face_plugin.faraday.meshers._native_worker", library]
        command += [str(given), str(made), str(int(memory))]
        # fTetWild writes a file __tracked_surface.stl to where it runs.
        child = subprocess.run(command, cwd=folder, env=environment(), capture_output=True, text=True, errors="replace")
        if child.returncode == 0 and made.exists():
            with np.load(made) as archive:
                return dict(archive)
    raise MeshingError(f"{library} {failure(child)}; {advice}")
