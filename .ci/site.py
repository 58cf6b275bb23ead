"""What the site needs besides `mkdocs.yml`: the pages about benchmarks lie beside the docs, not in them."""

from pathlib import Path

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[1]


def on_files(files, config):
    """Take the benchmarks' pages into the site."""
    for page in sorted((ROOT / "benchmarks").glob("*.md")):
        files.append(File.generated(config, f"benchmarks/{page.name}", abs_src_path=str(page)))
    return files


def on_page_markdown(markdown, page, config, files):
    """Links between the two folders are shorter within the site."""
    return markdown.replace("](../benchmarks/", "](benchmarks/").replace("](../docs/", "](../")
