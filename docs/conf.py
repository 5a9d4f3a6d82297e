"""Sphinx configuration."""

import re
import sys
from pathlib import Path

from docutils import nodes

from skfem_textile import __version__

sys.path.insert(0, str(Path(__file__).parent))

import api_pages
import data_links
import gallery_build
import generated_tables
import notebooks
import plain_markdown

project = "skfem_textile"
author = "The skfem_textile developers"
copyright = "2026, the skfem_textile developers"  # noqa: A001
release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",
    "sphinx_gallery.gen_gallery",
    "media",
]
templates_path = ["_templates"]
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autosummary_context = {
    "listed_on": api_pages.links_back(),
    # Their base classes are internal.
    "inherits": [
        f"skfem_textile.{name}"
        for name in ("Ply", "TensionOnly", "Asymmetric", "Traction", "BodyForce")
    ],
}
autosummary_filename_map = api_pages.file_names()
# Names in docstrings, between single backticks, are links where they have a page.
default_role = "py:obj"
myst_enable_extensions = ["dollarmath", "html_image"]
myst_heading_anchors = 3
# It makes a dash of the two before an option.
smartquotes = False
# Folders with results of studies contain tables, which pages include.
exclude_patterns = [
    "_build",
    *(file.parent.name for file in Path(__file__).parent.glob("*/provenance.json")),
]

sphinx_gallery_conf = gallery_build.CONFIGURATION

html_theme = "furo"
html_title = "skfem_textile"
html_static_path = ["_static"]
html_search_scorer = str(Path(__file__).with_name("search_order.js"))
# It would have all names on one page; the API has them by task, and the search by name.
html_use_index = False
html_css_files = ["wide.css", "narrow.css", "dark.css", "gallery.css"]

_CODE = (nodes.literal, nodes.literal_block, nodes.raw)
_NUMBER = re.compile(r"[-+<]? *\d[\d.]*(e[-+]?\d+)?( %)?")


def keep_numbers_whole(app, document):
    """Keep a number on one line: its exponent in a table, its percent sign anywhere."""
    for entry in document.findall(nodes.entry):
        if all(_NUMBER.fullmatch(part) for part in entry.astext().split(", ")):
            entry["classes"].append("number")
    for text in list(document.findall(nodes.Text)):
        if " %" in text and not isinstance(text.parent, _CODE):
            joined = text.replace(" %", "\N{NO-BREAK SPACE}%")
            text.parent.replace(text, nodes.Text(joined))


def write_tables(app, name, source):
    """Write generated tables in place of their markers, links to the data and menus."""
    page = Path(app.srcdir, f"{name}.md")
    text = data_links.with_data(generated_tables.filled(source[0]), page)
    source[0] = plain_markdown.for_sphinx(text, name)


def setup(app):
    """Connect what this file adds to Sphinx."""
    notebooks.write_tutorial()
    app.connect("builder-inited", api_pages.remove_stale, priority=100)
    app.connect("source-read", write_tables)
    app.connect("doctree-read", keep_numbers_whole)
    app.connect("autodoc-skip-member", api_pages.skip_field)
    app.connect("doctree-read", api_pages.remove_menus, priority=100)
