"""How the house is built: which room may import from which, read from the code itself."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# From the ground up: a module imports from its own room and from those before it.
ROOMS = [
    "ground",
    "io",
    "shapes",
    "ribbons",
    "examples",
    "faraday",
    "sides",
    "angles",
    "sculpt",
    "method",
    "reading",
    "solver",
    "tiles",
    "estimate",
    "filters",
    "adapters",
    "app",
    "cli",
]
LONGEST = {"adapters": 150}
LONGEST_ELSEWHERE = 300


def modules() -> dict[str, Path]:
    """Every module of the package, by its dotted name, without the package's own name before it."""
    found = {}
    for folder in ("face_plugin", "filters", "adapters"):
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            parts = parts[1:] if folder == "face_plugin" else parts
            found[".".join(part for part in parts if part != "__init__")] = path
    return found


MODULES = modules()


def room(module: str) -> str:
    first = module.split(".")[0]
    return first if first in ROOMS else "ground"


def imports(path: Path) -> list[tuple[str, str]]:
    """Every (module, name) that a file imports from the package, also within functions."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "face_plugin":
            base = ".".join(node.module.split(".")[1:])  # type: ignore[union-attr]
            for alias in node.names:
                inner = f"{base}.{alias.name}".lstrip(".")
                found.append((inner, "") if inner in MODULES else (base, alias.name))
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] == "face_plugin":
                    found.append((".".join(alias.name.split(".")[1:]), ""))
    return found


# The package's own front lists public names, which it looks up when they are asked for.
GRAPH = {name: {other for other, _ in imports(path) if other} for name, path in MODULES.items() if name}


def test_the_rooms_are_there():
    assert {room(name) for name in GRAPH} == set(ROOMS)
    assert all(other in MODULES for others in GRAPH.values() for other in others)


def test_no_module_imports_upward():
    upward = [
        f"{name} -> {other}"
        for name, others in GRAPH.items()
        for other in others
        if ROOMS.index(room(other)) > ROOMS.index(room(name))
    ]
    assert upward == []


def test_no_circle():
    done: set[str] = set()

    def visit(name: str, way: tuple[str, ...]) -> None:
        assert name not in way, " -> ".join([*way, name])
        if name not in done:
            for other in sorted(GRAPH[name]):
                visit(other, (*way, name))
            done.add(name)

    for name in sorted(GRAPH):
        visit(name, ())


def test_no_module_imports_a_private_name():
    private = [
        f"{name}: {other}.{what}".rstrip(".")
        for name, path in MODULES.items()
        for other, what in imports(path)
        for word in [*other.split("."), what]
        if word.startswith("_") and not word.startswith("__")
    ]
    assert private == []


@pytest.mark.parametrize("name", sorted(MODULES))
def test_files_are_short(name):
    lines = len(MODULES[name].read_text(encoding="utf-8").splitlines())
    assert lines <= LONGEST.get(room(name), LONGEST_ELSEWHERE)
