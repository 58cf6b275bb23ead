"""The examples in the docstrings do what they print."""

import doctest
import importlib
import pkgutil

import pytest

import face_plugin

NAMES = sorted(module.name for module in pkgutil.walk_packages(face_plugin.__path__, "face_plugin."))
# Modules that run when imported.
NAMES = [name for name in NAMES if not name.endswith("__main__")]


@pytest.mark.parametrize("name", NAMES)
def test_the_examples_are_right(name):
    module = importlib.import_module(name)
    found = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    assert found.failed == 0, f"{found.failed} of {found.attempted} lines"
