"""Sphinx configuration."""

import re
import sys
from pathlib import Path

from docutils import nodes

from skfem_textile import __version__
from skfem_textile.cases.write import reference

sys.path.insert(0, str(Path(__file__).parent))

import gallery_build

project = "skfem_textile"
author = "The skfem_textile developers"
copyright = "2026, the skfem_textile developers"  # noqa: A001
release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",
    "sphinx_gallery.gen_gallery",
    "sphinxarg.ext",
]
autodoc_typehints = "none"
autodoc_member_order = "bysource"
myst_enable_extensions = ["dollarmath"]
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


def write_every_key(app, name, source):
    """Write the tables of all keys of a case file in place of their marker."""
    marker = "EVERY-KEY-OF-A-CASE"
    if marker in source[0]:
        source[0] = source[0].replace(marker, "\n".join(_key_tables()))


def _key_tables():
    table = None
    for own in reference():
        if own.table != table:
            table = own.table
            yield f"\n### `[{table}]`\n"
            yield "| key | type | default | meaning |\n|---|---|---|---|"
        only = f" ({own.choice})" if own.choice else ""
        default = f"`{own.default}`" if own.default else ""
        kind = own.kind.replace("|", "or")
        yield f"| `{own.key}`{only} | {kind} | {default} | {own.about} |"


def remove_comments(app, name, source):
    """Remove the markers of results, which are comments within sentences and cells."""
    source[0] = re.sub(r"<!--.*?-->", "", source[0])


def setup(app):
    """Connect what this file adds to Sphinx."""
    app.connect("source-read", write_every_key)
    app.connect("source-read", remove_comments)
    app.connect("doctree-read", keep_numbers_whole)
