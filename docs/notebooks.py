"""The tutorial and the scripts of the gallery as notebooks.

``python docs/notebooks.py`` writes each beside its source, and so beside its data.
"""

import re
from pathlib import Path

import gallery_build
from sphinx_gallery.notebook import (
    add_code_cell,
    add_markdown_cell,
    jupyter_notebook_skeleton,
    python_to_jupyter_cli,
    save_notebook,
)

ROOT = Path(__file__).parents[1]
TUTORIAL = ROOT / "docs" / "tutorial"

# A notebook needs neither the whole script nor what follows it.
_END = "## The whole script"

_CODE = re.compile(r"^```python\n(.*?)^```\n", re.M | re.S)

# Parts that only Sphinx shows, and links to other pages: a notebook stands alone.
_REPLACED = (
    (re.compile(r"^<img .*\n", re.M), ""),
    (re.compile(r"\[([^\]]+)\]\((?!https:)[^)]+\)"), r"\1"),
)


def write_tutorial() -> None:
    """Write the tutorial beside its page, as ``tutorial.ipynb``."""
    page = (TUTORIAL / "index.md").read_text(encoding="utf-8").partition(_END)[0]
    notebook = jupyter_notebook_skeleton()
    add_code_cell(notebook, gallery_build.SHOW_PICTURES)
    for number, part in enumerate(_CODE.split(page)):
        if number % 2:
            add_code_cell(notebook, part)
        elif text := _text(part):
            add_markdown_cell(notebook, text)
    save_notebook(notebook, TUTORIAL / "tutorial.ipynb")


def _text(part: str) -> str:
    """The text between two snippets, as notebooks show it."""
    for found, replacement in _REPLACED:
        part = found.sub(replacement, part)
    return part.strip()


def write_gallery() -> None:
    """Write each script of the gallery as a notebook beside it."""
    heads = (ROOT / "examples").rglob("GALLERY_HEADER.rst")
    folders = [head.parent for head in heads]
    scripts = [str(script) for folder in folders for script in folder.glob("*.py")]
    python_to_jupyter_cli(scripts, sphinx_gallery_conf=gallery_build.CONFIGURATION)


if __name__ == "__main__":
    write_tutorial()
    write_gallery()
