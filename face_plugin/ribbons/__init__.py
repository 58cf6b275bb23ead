"""Ribbon sketches drawn in virtual reality: read, sampled evenly, and given outward normals.

A sketch is a set of strokes, each an open ribbon (a strip of triangles), which overlap, leave gaps and cross
the inside of the object (Rosales et al. 2019, "SurfaceBrush"; section 4 of the FaCE paper).
"""

from face_plugin.ribbons.generator import teapot_sketch
from face_plugin.ribbons.reading import read_sketch, write_normals
from face_plugin.ribbons.sampling import Samples, normals_at_vertices, sample
from face_plugin.ribbons.sketch import Sketch, sparsify
from face_plugin.ribbons.strokes import Stroke, ribbons

__all__ = [
    "Samples",
    "Sketch",
    "Stroke",
    "normals_at_vertices",
    "read_sketch",
    "ribbons",
    "sample",
    "sparsify",
    "teapot_sketch",
    "write_normals",
]
