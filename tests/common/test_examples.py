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
def test_examples_run_and_keep_their_promise(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")


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
