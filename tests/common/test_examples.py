"""What the documentation shows works, and what it names exists."""

import re
import runpy
from pathlib import Path

import pytest

from skfem_textile.cli.case import case_from_file

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "examples").rglob("*.py"))
EXAMPLES = [script for script in SCRIPTS if script.stem != "half_size"]
CASES = sorted((ROOT / "examples").rglob("*.toml"))
OPTIONAL = ("pyvista", "matplotlib", "pypardiso", "cvxopt", "dask")
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text()
CODE = "".join(
    file.read_text()
    for folder in ("skfem_textile", "studies", "tests")
    for file in (ROOT / folder).rglob("*.py")
)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run_and_leave_a_picture(example, tmp_path, monkeypatch):
    """They assert what their text promises; the gallery shows their pictures."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pytest.importorskip("pyvista")
    monkeypatch.chdir(tmp_path)
    try:
        with pyplot.rc_context({"backend": "agg"}):
            runpy.run_path(str(example), run_name="__main__")
    finally:
        pyplot.close("all")
    assert list(tmp_path.rglob("*.png"))


def test_a_script_of_the_gallery_has_a_title_and_a_text():
    """A page needs them; the first paragraph is its summary in the index."""
    for example in EXAMPLES:
        title, line, _, text = example.read_text().split("\n", 5)[1:5]
        assert line == "=" * len(title), example
        assert text, example


@pytest.mark.parametrize("case", CASES, ids=lambda path: path.stem)
def test_case_files_among_the_examples_are_cases(case):
    assert case_from_file(case).ply().basis.N > 0


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_python_on_a_page_works_as_printed(page, tmp_path, monkeypatch):
    """The snippets of a page build on one another."""
    monkeypatch.chdir(tmp_path)
    variables, missing = {"__name__": page.stem}, set()
    for snippet in re.findall(r"^```python\n(.*?)^```", page.read_text(), re.M | re.S):
        try:
            exec(compile(snippet, page.name, "exec"), variables)
        except ModuleNotFoundError as error:
            if error.name not in OPTIONAL:
                raise
            missing.add(error.name)
    if missing:
        pytest.skip(f"but for snippets that need {', '.join(missing)}")


def test_the_page_on_the_architecture_names_what_there_is():
    places = set(re.findall(r"`((?:[a-z_]+/)+(?:[a-z_]+\.py)?)`", ARCHITECTURE))
    bases = ROOT, ROOT / "skfem_textile"
    assert [p for p in places if not any((b / p).exists() for b in bases)] == []
    names = set(re.findall(r"`(?:[A-Z]\w+\.)?(_?[A-Za-z]\w{3,})`", ARCHITECTURE))
    assert len(places) > 30
    assert len(names) > 60
    assert [n for n in names if not re.search(rf"\b{n}\b", CODE)] == []
