"""Sphinx configuration."""

import sys
from pathlib import Path

from skfem_textile import __version__

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
exclude_patterns = ["_build", "error-time", "speed", "paper", "stability"]

sphinx_gallery_conf = gallery_build.CONFIGURATION

html_theme = "furo"
html_title = "skfem_textile"
html_static_path = ["_static"]
html_css_files = ["wide.css", "gallery.css"]
