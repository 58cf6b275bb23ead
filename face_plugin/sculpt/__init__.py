"""Refinement of a solved cage by hand: charges carve, cage points shield (paper sections 3.1.2 and 3.6)."""

from face_plugin.sculpt.file import SculptFile
from face_plugin.sculpt.sculptable import Sculptable
from face_plugin.sculpt.sculptor import Edit

__all__ = ["Edit", "SculptFile", "Sculptable"]
