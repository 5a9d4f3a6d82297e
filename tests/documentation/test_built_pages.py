"""The check of the built pages finds what breaks where they are served."""

import pytest

from tests.helpers import built_pages
from tests.helpers.built_pages import ROOT, defects

GOOD = """<a id="top" href="other.html#part">x</a> <a href="https://example.org">y</a>
<img src="data:image/png;base64,AA"> <link href="style.css"> <a href="#top">z</a>"""


@pytest.fixture
def build(tmp_path):
    """Two pages without a defect, in a folder below another file."""
    folder = tmp_path / "build"
    (folder / "sub").mkdir(parents=True)
    (folder / "index.html").write_text(GOOD)
    (folder / "other.html").write_text('<p id="part"><a href="index.html">x</a>')
    (folder / "style.css").write_text("p {}")
    (tmp_path / "outside.html").write_text("")
    return folder


def test_links_within_the_pages_and_to_other_sites_are_right(build):
    assert list(defects(build)) == []


@pytest.mark.parametrize(
    ("tag", "reason"),
    [
        ('<a href="lost.html">', "missing"),
        ('<a href="../other.html#lost">', "anchor"),
        ('<a href="#lost">', "anchor"),
        ('<a href="/index.html">', "absolute"),
        ('<img src="file:///pictures/strip.png">', "absolute"),
        ('<script src="//example.org/x.js">', "absolute"),
        ('<a href="../../outside.html">', "out of the pages"),
        ('<script src="https://example.org/x.js">', "network"),
        ('<img srcset="../style.css 1x, lost.png 2x">', "missing"),
        (f"<p>{ROOT}/docs</p>", "path of the repository"),
    ],
)
def test_each_kind_of_defect_is_found(tag, reason, build):
    (build / "sub" / "page.html").write_text(tag)
    (defect,) = defects(build)
    assert defect.startswith("sub/page.html: ")
    assert reason in defect


def test_a_script_of_the_gallery_without_its_picture_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(built_pages, "ROOT", tmp_path)
    scripts, pages = tmp_path / "examples" / "a", tmp_path / "gallery" / "a"
    for folder in (scripts, pages):
        folder.mkdir(parents=True)
    (scripts / "GALLERY_HEADER.rst").touch()
    for name in ("drawn", "blank", "lost"):
        (scripts / f"{name}.py").touch()
    (pages / "drawn.html").write_text('<img src="../sphx_glr_drawn_001.png">')
    (pages / "blank.html").write_text('<img src="icon.png">')
    without = built_pages.without_picture(tmp_path)
    assert [script.stem for script in without] == ["blank", "lost"]
