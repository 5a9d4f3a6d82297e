"""Scripts of the gallery run as notebooks, and show their pictures.

All scripts run when the gallery is built, and the tutorial as snippets of its page.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BINDER = ROOT / ".binder"
#: With data beside it and pictures of Matplotlib, and with pictures in space.
SCRIPTS = "examples/fabrics/measured_fabric", "examples/meshes/hole"
TUTORIAL = "docs/tutorial/tutorial"

#: A cell that takes longer hangs.
MOST_SECONDS = 60


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A copy of the pages and examples, after the last step of Binder's build."""
    pytest.importorskip("sphinx_gallery")
    folder = tmp_path_factory.mktemp("binder")
    ignored = shutil.ignore_patterns("_build", "gallery", "generated")
    for name in ("docs", "examples"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    command = re.search(r"^python (.*)$", (BINDER / "postBuild").read_text(), re.M)[1]
    subprocess.run([sys.executable, command], cwd=folder, check=True)
    return folder


def pictures(notebook):
    """Number of pictures that the cells of a notebook show."""
    outputs = (out for cell in notebook.cells for out in cell.get("outputs", ()))
    kinds = [kind for out in outputs for kind in out.get("data", ())]
    return sum(kind in {"image/png", "image/gif"} for kind in kinds)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_a_notebook_runs_and_shows_its_pictures(name, built):
    pytest.importorskip("ipykernel")
    nbclient, nbformat = map(pytest.importorskip, ("nbclient", "nbformat"))
    file = built / f"{name}.ipynb"
    notebook = nbformat.read(file, as_version=4)
    place = {"metadata": {"path": str(file.parent)}}
    nbclient.NotebookClient(notebook, timeout=MOST_SECONDS, resources=place).execute()
    assert pictures(notebook) > 0


@pytest.mark.slow
def test_the_notebook_of_the_tutorial_contains_its_snippets_and_no_markup(built):
    nbformat = pytest.importorskip("nbformat")
    cells = nbformat.read(built / f"{TUTORIAL}.ipynb", as_version=4).cells
    code = [cell.source for cell in cells if cell.cell_type == "code"]
    text = "".join(cell.source for cell in cells if cell.cell_type == "markdown")
    page = (ROOT / "docs" / "tutorial" / "index.md").read_text()
    snippets = re.findall(r"^```python\n(.*?)^```", page, re.M | re.S)
    assert code[1:] == [snippet.strip() for snippet in snippets]
    assert re.findall(r"\{\w+\}|<!--|\.\./", text) == []


def test_binder_installs_the_packages_that_pictures_need():
    page = (ROOT / "CONTRIBUTING.md").read_text()
    needed = re.search(r"apt-get install ([\w -]+)` on\s+Debian", page)[1]
    assert (BINDER / "apt.txt").read_text().split() == needed.split()
