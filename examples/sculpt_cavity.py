"""A closed cavity, which the outer field cannot see, put right by one charge inside it.

    python examples/sculpt_cavity.py [--points N] [--out FOLDER]

A spherical shell: without help its cavity is read as another body. The picture is sculpt_cavity.png, and the
edit is kept in sculpt_cavity.json for `face mesh --sculpt`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from panels import aligned
from sculpt_panels import BeforeAfter

from face_plugin import FaCE
from face_plugin.sculpt import SculptFile
from face_plugin.shapes import spherical_shell


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=4000)
    parser.add_argument("--out", type=Path, default=Path("out"))
    args = parser.parse_args()
    shell = spherical_shell(args.points)
    face = FaCE(shell.points)
    pictures = BeforeAfter(shell.points, shell.normals)
    pictures.add("before", face)
    print(f"before: {aligned(face.normals(), shell.normals):.1f} % aligned")
    (charge,) = face.add_charges([[0.0, 0.0, 0.0]])
    share = aligned(face.normals(), shell.normals)
    print(f"charge at {charge.places[0].round(2)}: {share:.1f} % aligned")
    pictures.add("one charge", face)
    pictures.save(args.out / "sculpt_cavity.png")
    SculptFile.of(face.edits).save(args.out / "sculpt_cavity.json")


if __name__ == "__main__":
    main()
