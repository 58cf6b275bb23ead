"""`python -m face_plugin.app.cli` is the same as `face`."""

import sys

from face_plugin.app.cli import main

if __name__ == "__main__":
    sys.exit(main())
