"""A mug whose inside is too deep for the outer field, put right by charges (the paper's figure 5).

    python examples/sculpt_mug.py [--points N] [--out FOLDER]

The picture sculpt_mug.png shows points and surface, cut open, before and after.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from panels import aligned
from sculpt_panels import BeforeAfter

from face_plugin import FaCE
from face_plugin.shapes import cup


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=5000)
    parser.add_argument("--out", type=Path, default=Path("out"))
    args = parser.parse_args()
    mug = cup(args.points, depth=3.0)
    face = FaCE(mug.points)
    pictures = BeforeAfter(mug.points, mug.normals)
    pictures.add("before", face)
    print(f"before: {aligned(face.normals(), mug.normals):.1f} % aligned")
    for height in (0.3, 1.2):
        (charge,) = face.add_charges([[0.0, 0.0, height]])
        share = aligned(face.normals(), mug.normals)
        print(f"charge at {charge.places[0].round(2)}: {share:.1f} % aligned")
    pictures.add("two charges", face)
    pictures.save(args.out / "sculpt_mug.png")


if __name__ == "__main__":
    main()
