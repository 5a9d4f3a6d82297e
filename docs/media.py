"""Directives of the pages for videos, and for results that readers turn in 3D.

A page loads both without a network, also if it is opened as a file.
"""

import base64
from html import escape
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

VIEWER = "_static/model-viewer/model-viewer-umd.min.js"

_VIDEO = (
    '<video autoplay muted loop playsinline controls width="100%" src="{source}" '
    'poster="{poster}" aria-label="{alt}"></video>'
)
# Data within the page: browsers do not let a page that is a file read other files.
_MODEL = (
    '<model-viewer camera-controls touch-action="pan-y" interaction-prompt="none" '
    'tone-mapping="neutral" camera-orbit="{orbit}" alt="{alt}" '
    'src="data:model/gltf+json;base64,{data}"></model-viewer>'
)


class Medium(SphinxDirective):
    """Something shown, with a text that replaces it, and a caption below it."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar = {"alt": directives.unchanged_required}

    def file(self, name: str) -> Path:
        """Path of a file, given relative to the page, on which the page depends."""
        path = self.env.relfn2path(name)[1]
        self.env.note_dependency(path)
        return Path(path)

    def copied(self, name: str) -> str:
        """Address of a copy of a file in the built pages."""
        path = self.env.relfn2path(name)[0]
        copy = self.env.dlfiles.add_file(self.env.docname, path)
        return f"{self.root}_downloads/{copy}"

    @property
    def root(self) -> str:
        """Address of the top of the pages."""
        return "../" * self.env.docname.count("/")

    def figure(self, html: str) -> list[nodes.Node]:
        """Nodes with the content of the directive as a caption."""
        figure = nodes.figure("", nodes.raw("", html, format="html"))
        paragraphs = self.parse_content_to_nodes()
        if paragraphs:
            caption = nodes.caption("", "", *paragraphs[0].children)
            figure += caption
        return [figure]


class Video(Medium):
    """A video that plays by itself, without sound, over and over."""

    option_spec: ClassVar = {
        **Medium.option_spec,
        "poster": directives.unchanged_required,
    }

    def run(self) -> list[nodes.Node]:
        """Nodes of the video."""
        html = _VIDEO.format(
            source=self.copied(self.arguments[0]),
            poster=self.copied(self.options["poster"]),
            alt=escape(self.options["alt"]),
        )
        return self.figure(html)


class Model(Medium):
    """A glTF file in a viewer."""

    option_spec: ClassVar = {**Medium.option_spec, "orbit": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """Nodes of the viewer; the first one on a page loads its script."""
        html = _MODEL.format(
            alt=escape(self.options["alt"]),
            data=base64.b64encode(self.file(self.arguments[0]).read_bytes()).decode(),
            orbit=self.options.get("orbit", "30deg 60deg 75%"),
        )
        if "model-viewer" not in self.env.temp_data:
            self.env.temp_data["model-viewer"] = True
            html = f'<script defer src="{self.root}{VIEWER}"></script>' + html
        return self.figure(html)


def setup(app):
    """Add the directives."""
    app.add_directive("video", Video)
    app.add_directive("model", Model)
    return {"parallel_read_safe": True}
