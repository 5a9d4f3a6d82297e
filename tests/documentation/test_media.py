"""Videos and models of the pages need no network and are valid."""

import base64
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs"
VIEWER = DOCS / "_static" / "model-viewer"
MODELS = sorted((DOCS / "models").glob("*.gltf"))
MB = 10**6


def test_the_viewer_is_shipped_with_its_licence_and_source():
    (script,) = VIEWER.glob("*.js")
    assert script.stat().st_size < 1.2 * MB
    assert "Apache License" in (VIEWER / "LICENSE").read_text()
    stated = (VIEWER / "README.txt").read_text()
    assert re.search(r"version \d+\.\d+\.\d+.* npm package ", stated, re.S)


@pytest.mark.parametrize("file", MODELS, ids=lambda file: file.stem)
def test_a_model_is_valid_and_refers_to_nothing(file):
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.load(file)
    for geometry in scene.geometry.values():
        assert np.isfinite(geometry.vertices).all()
        assert len(geometry.faces) > 0
    content = json.loads(file.read_text())
    parts = content["buffers"] + content["images"]
    assert all(part.get("uri", "data:").startswith("data:") for part in parts)
    assert "extensionsUsed" not in content  # decoders would be loaded


def test_all_models_are_shown():
    text = (DOCS / "how-to" / "results-in-3d.md").read_text()
    shown = re.findall(r"^```{model} \.\./models/(\S+)\n:alt: \S", text, re.M)
    assert sorted(shown) == [file.name for file in MODELS]
    assert len(MODELS) == 3


def test_video_and_animation_are_small():
    images = DOCS / "images"
    assert (images / "forming.webm").stat().st_size < 1.5 * MB
    assert (images / "forming.gif").stat().st_size < 3 * MB


def test_a_built_page_loads_only_what_is_built_with_it(tmp_path):
    application = pytest.importorskip("sphinx.application")
    pytest.importorskip("myst_parser")
    (tmp_path / "below").mkdir()
    (tmp_path / "conf.py").write_text(
        f"extensions = ['myst_parser', 'media']\nhtml_static_path = [{str(VIEWER)!r}]"
    )
    (tmp_path / "index.md").write_text("# A\n\n```{toctree}\nbelow/page\n```\n")
    for name in ("x.gltf", "y.gltf", "x.webm", "x.png"):
        (tmp_path / name).write_bytes(name.encode())
    (tmp_path / "below" / "page.md").write_text(
        '# B\n\n```{model} ../x.gltf\n:alt: an "x"\n\nCaption with `code`.\n```\n\n'
        "```{model} ../y.gltf\n:alt: y\n```\n\n"
        "```{video} ../x.webm\n:poster: ../x.png\n:alt: moving\n```\n"
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
    sources = re.findall(r'(?:src|poster)="([^"]*)"', text)
    data = [x for x in sources if x.startswith("data:")]
    assert [base64.b64decode(x.partition(",")[2]) for x in data] == [
        b"x.gltf",
        b"y.gltf",
    ]
    script, *others = [x for x in sources if x not in data]
    assert script.endswith("model-viewer/model-viewer-umd.min.js")
    assert not script.startswith("http")
    contents = [(page.parent / x).resolve().read_bytes() for x in others]
    assert contents == [b"x.webm", b"x.png"]
    assert "Caption with" in text
    assert 'alt="an &quot;x&quot;"' in text
    assert 'aria-label="moving"' in text
