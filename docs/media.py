"""Directive of the pages for results that readers turn in 3D.

A page loads them without a network, also if it is opened as a file.
"""

import base64
import subprocess
import sys
from html import escape
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

VIEWER = "_static/model-viewer/model-viewer-umd.min.js"

# Data within the page: browsers do not let a page that is a file read other files.
_MODEL = (
    '<model-viewer camera-controls touch-action="pan-y" interaction-prompt="none" '
    'tone-mapping="neutral" camera-orbit="{orbit}" alt="{alt}" '
    'src="data:model/gltf+json;base64,{data}"></model-viewer>'
)


class Model(SphinxDirective):
    """A glTF file in a viewer, with a text that replaces it, and a caption below it."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar = {
        "alt": directives.unchanged_required,
        "orbit": directives.unchanged,
    }

    def run(self) -> list[nodes.Node]:
        """Nodes of the viewer; the first one on a page loads its script."""
        path = self.env.relfn2path(self.arguments[0])[1]
        self.env.note_dependency(path)
        html = _MODEL.format(
            alt=escape(self.options["alt"]),
            data=base64.b64encode(Path(path).read_bytes()).decode(),
            orbit=self.options.get("orbit", "30deg 60deg 75%"),
        )
        if "model-viewer" not in self.env.temp_data:
            self.env.temp_data["model-viewer"] = True
            root = "../" * self.env.docname.count("/")
            html = f'<script defer src="{root}{VIEWER}"></script>' + html
        figure = nodes.figure("", nodes.raw("", html, format="html"))
        if paragraphs := self.parse_content_to_nodes():
            figure += nodes.caption("", "", *paragraphs[0].children)
        return [figure]


def write_models(app: Any) -> None:
    """Compute the models of the pages, which are not under version control."""
    folder = Path(app.srcdir) / "models"
    script = Path(app.srcdir).parent / "examples" / "media" / "results_in_3d.py"
    if script.is_file() and not list(folder.glob("*.gltf")):
        folder.mkdir(exist_ok=True)
        subprocess.run([sys.executable, script, folder], check=True)


def setup(app):
    """Add the directive."""
    app.connect("builder-inited", write_models)
    app.add_directive("model", Model)
    return {"parallel_read_safe": True}
