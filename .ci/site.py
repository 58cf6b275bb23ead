"""What the site needs besides `mkdocs.yml`: benchmarks lie beside the docs, and the gallery shows the examples."""

import ast
from pathlib import Path

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[1]


def on_files(files, config):
    """Take the benchmarks' pages into the site."""
    for page in sorted((ROOT / "benchmarks").glob("*.md")):
        files.append(File.generated(config, f"benchmarks/{page.name}", abs_src_path=str(page)))
    return files


def on_page_markdown(markdown, page, config, files):
    """Shorten links between the two folders, and show the examples where their pictures stand."""
    markdown = markdown.replace("](../benchmarks/", "](benchmarks/").replace("](../docs/", "](../")
    if page.file.src_uri == "gallery.md":
        for example in sorted((ROOT / "examples").glob("*.py")):
            markdown = markdown.replace(f"<!-- source: {example.name} -->", _source(example))
    return markdown


def _source(example):
    """Fold up an example's code below what it says of itself."""
    text = example.read_text(encoding="utf-8")
    shown = "".join(f"    {line}\n" if line else "\n" for line in text.splitlines())
    what = ast.get_docstring(ast.parse(text)).splitlines()[0]
    return f'{what}\n\n??? example "examples/{example.name}"\n\n    ```python\n{shown}    ```\n'
