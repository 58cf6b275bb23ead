"""Synthetic clouds with exact truth, for tests, examples, benchmarks and the demo.

Every generator takes the number of points and a seed and returns a `Shape`; the same arguments give the
same bytes. Lengths are of order one.
"""

from face_plugin.shapes.bodies import (
    bowl,
    box,
    crossed_cylinders,
    cup,
    demo_shape,
    disjoint_spheres,
    doubled_shell,
    ellipsoid,
    nested_box,
    open_sheet,
    shelves,
    slab,
    sphere,
    spherical_shell,
    teapot,
    torus,
    two_spheres,
)
from face_plugin.shapes.sampling import evenly
from face_plugin.shapes.shape import Shape, from_solids, with_noise, with_outliers

__all__ = [
    "Shape",
    "bowl",
    "box",
    "crossed_cylinders",
    "cup",
    "demo_shape",
    "disjoint_spheres",
    "doubled_shell",
    "ellipsoid",
    "evenly",
    "from_solids",
    "nested_box",
    "open_sheet",
    "shelves",
    "slab",
    "sphere",
    "spherical_shell",
    "teapot",
    "torus",
    "two_spheres",
    "with_noise",
    "with_outliers",
]
