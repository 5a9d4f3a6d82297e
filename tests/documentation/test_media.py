"""Models of the pages need no network; the animation is small."""

import base64
import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
VIEWER = DOCS / "_static" / "model-viewer"
MB = 10**6


def test_the_viewer_is_shipped_with_its_licence_and_source():
    (script,) = VIEWER.glob("*.js")
    assert script.stat().st_size < 1.2 * MB
    assert "Apache License" in (VIEWER / "LICENSE").read_text()
    stated = (VIEWER / "README.txt").read_text()
    assert re.search(r"version \d+\.\d+\.\d+.* npm package ", stated, re.S)


def test_all_models_are_shown():
    text = (DOCS / "how-to" / "results-in-3d.md").read_text()
    shown = re.findall(r"^```{model} \.\./models/(\S+)\.gltf\n:alt: \S", text, re.M)
    script = DOCS.parent / "examples" / "media" / "results_in_3d.py"
    written = re.findall(r'^        "(\w+)": run', script.read_text(), re.M)
    assert sorted(shown) == sorted(written)


def test_the_animation_is_small():
    assert (DOCS / "images" / "forming.gif").stat().st_size < 1.5 * MB


def test_a_built_page_loads_only_what_is_built_with_it(tmp_path):
    application = pytest.importorskip("sphinx.application")
    pytest.importorskip("myst_parser")
    (tmp_path / "below").mkdir()
    (tmp_path / "conf.py").write_text(
        f"extensions = ['myst_parser', 'media']\nhtml_static_path = [{str(VIEWER)!r}]"
    )
    (tmp_path / "index.md").write_text("# A\n\n```{toctree}\nbelow/page\n```\n")
    for name in ("x.gltf", "y.gltf"):
        (tmp_path / name).write_bytes(name.encode())
    (tmp_path / "below" / "page.md").write_text(
        '# B\n\n```{model} ../x.gltf\n:alt: an "x"\n\nCaption with `code`.\n```\n\n'
        "```{model} ../y.gltf\n:alt: y\n```\n\n"
    )
    before = list(sys.path)
    sys.path.insert(0, str(DOCS))
    try:
        folders = tmp_path, tmp_path, tmp_path / "out", tmp_path / "trees"
        application.Sphinx(*folders, "html", status=None).build()
    finally:
        sys.path[:] = before
    page = tmp_path / "out" / "below" / "page.html"
    text = page.read_text().partition("<section")[2].partition("</section>")[0]
    sources = re.findall(r'src="([^"]*)"', text)
    data = [x for x in sources if x.startswith("data:")]
    assert [base64.b64decode(x.partition(",")[2]) for x in data] == [
        b"x.gltf",
        b"y.gltf",
    ]
    (script,) = [x for x in sources if x not in data]
    assert script.endswith("model-viewer/model-viewer-umd.min.js")
    assert not script.startswith("http")
    assert "Caption with" in text
    assert 'alt="an &quot;x&quot;"' in text
