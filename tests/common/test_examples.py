import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
OPTIONAL = ("pyvista", "matplotlib", "imageio", "pypardiso", "cvxopt", "dask")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run_and_keep_their_promise(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")


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
