"""The command line under the name that it had in version 0.1; it lives in `face_plugin.app.cli`."""

from face_plugin.app.cli import main

__all__ = ["main"]
