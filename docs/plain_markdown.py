"""Menus, tables and built pages in place of what a code host shows of a page.

A page is plain Markdown: it links to its tables, and to the sources of pages that
Sphinx builds.  Its menu is in ``menus.toml``.
"""

import re
import tomllib
from pathlib import Path

#: A link to a table of a study that fills a line.
TABLE = re.compile(r"^\[Table: [^\]]+\]\((\S+)\)$", re.MULTILINE)

#: Built pages by their source, as linked from the page that is its neighbour.
BUILT = {"../examples": "gallery/index.rst", "../notebooks.py": "tutorial.ipynb"}

#: The pages below each page.
MENUS: dict[str, list[str]] = tomllib.loads(
    Path(__file__).with_name("menus.toml").read_text(encoding="utf-8")
)


def for_sphinx(text: str, page: str) -> str:
    """The text of a page with its tables, its links to built pages and its menu.

    Parameters
    ----------
    text
        The page.
    page
        Its name, as ``how-to/index``.
    """
    text = TABLE.sub(lambda match: f"```{{include}} {match[1]}\n```", text)
    for source, built in BUILT.items():
        text = text.replace(f"]({source})", f"]({built})")
    if entries := MENUS.get(page):
        text += "\n".join(["\n```{toctree}\n:hidden:\n", *entries, "```\n"])
    return text
