"""Snippets of the documentation run and print what it shows.

The scripts of the gallery run when the documentation is built.
"""

import re
import runpy
import shutil
from pathlib import Path

import pytest

from skfem_textile.cases import case_from_file

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "examples").rglob("*.py"))
#: Those of the gallery; others write what the pages show.
EXAMPLES = [x for x in SCRIPTS if x.parent.name not in ("hole", "media", "part")]
CASES = sorted((ROOT / "examples").rglob("*.toml"))
OPTIONAL = ("pyvista", "matplotlib", "pypardiso", "cvxopt", "dask")
ARCHITECTURE = "".join(
    (ROOT / "docs" / "reference" / f"{name}.md").read_text()
    for name in ("architecture", "decisions")
)
CODE = "".join(
    file.read_text()
    for folder in ("skfem_textile", "studies", "tests")
    for file in (ROOT / folder).rglob("*.py")
)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TUTORIAL = ROOT / "docs" / "tutorial"
SNIPPET = re.compile(r"^```python\n(.*?)^```", re.M | re.S)
WITH_SNIPPETS = {
    str(page.relative_to(ROOT).with_suffix("")): page
    for page in PAGES
    if page.parent != TUTORIAL and SNIPPET.search(page.read_text())
}

#: Pages whose blocks of text no snippet prints: messages about invalid case files.
OTHER_TEXT = {"docs/how-to/case-files"}


def test_the_strip_prints_a_short_table_with_units_and_no_warnings(
    tmp_path, monkeypatch, capsys, caplog
):
    pytest.importorskip("skfem_textile.plot")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("skfem_textile.plot.shear_angle", no_picture, raising=False)
    strip = runpy.run_path(str(ROOT / "examples" / "strip.py"))
    strip["main"].__globals__["draw_locking"] = no_picture
    strip["main"]()
    printed, announced = capsys.readouterr()
    for label in ("energy (N·mm)", "force (N)", "position error, rms over nodes (mm)"):
        assert re.search(rf"^{re.escape(label)} +-?[\d.]+ ", printed, re.M)
    assert len(printed.splitlines()) <= 12
    assert caplog.text == announced == ""


def no_picture(*_, **__):
    raise RuntimeError


def test_a_script_of_the_gallery_has_a_title_and_a_text():
    """A page needs them; the first paragraph is its summary in the index."""
    for example in EXAMPLES:
        title, line, _, text = example.read_text().split("\n", 5)[1:5]
        assert line == "=" * len(title), example
        assert text, example


@pytest.mark.parametrize("case", CASES, ids=lambda path: path.stem)
def test_case_files_among_the_examples_are_valid(case):
    assert case_from_file(case).ply().basis.N > 0


def run_snippets(page):
    """Run the snippets of a page in one namespace, beside the files that it offers."""
    text = page.read_text()
    for offered in re.findall(r"\]\(([\w./-]+\.(?!md|ipynb)\w+)\)", text):
        shutil.copy(page.parent / offered, ".")
    variables, missing = {"__name__": page.stem}, set()
    for snippet in SNIPPET.findall(text):
        try:
            exec(compile(snippet, page.name, "exec"), variables)
        except ModuleNotFoundError as error:
            if error.name not in OPTIONAL:
                raise
            missing.add(error.name)
    if missing:
        pytest.skip(f"but for snippets that need {', '.join(missing)}")


def blocks_of_text(page):
    """The output blocks of a page, in the parts between its lines of three dots."""
    blocks = re.findall(r"^```text\n(.*?)^```", page.read_text(), re.M | re.S)
    return [part for block in blocks for part in block.split("...\n")]


def in_one_line(text):
    return " ".join(text.split())


@pytest.mark.parametrize("page", WITH_SNIPPETS)
def test_snippets_of_a_page_print_its_output(page, tmp_path, monkeypatch, capsys):
    """The snippets of a page build on one another."""
    monkeypatch.chdir(tmp_path)
    run_snippets(WITH_SNIPPETS[page])
    printed = in_one_line(capsys.readouterr().out)
    blocks = [] if page in OTHER_TEXT else blocks_of_text(WITH_SNIPPETS[page])
    assert [block for block in blocks if in_one_line(block) not in printed] == []


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_first_examples_show_the_error_of_their_load(page):
    assert re.search(r"load: \d|load \S+ ± \d", "".join(blocks_of_text(ROOT / page)))


def test_the_tutorial_prints_its_listed_output(tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyvista")
    monkeypatch.chdir(tmp_path)
    run_snippets(TUTORIAL / "index.md")
    printed = capsys.readouterr().out
    blocks = blocks_of_text(TUTORIAL / "index.md")
    assert len(blocks) == 7
    assert [block for block in blocks if block not in printed] == []


def test_the_whole_script_of_the_tutorial_consists_of_its_parts():
    def statements(text):
        text = re.sub(
            r'^""".*?"""\n|^from \S+ import \(.*?\)', "", text, flags=re.M | re.S
        )
        lines = [line for line in text.splitlines() if line.strip()]
        return [x for x in lines if not x.startswith(("import ", "from ", "# Part"))]

    parts = SNIPPET.findall((TUTORIAL / "index.md").read_text())
    assert statements((TUTORIAL / "whole.py").read_text()) == statements("".join(parts))


def test_the_page_on_the_architecture_names_existing_modules():
    paths = set(re.findall(r"`((?:[a-z_]+/)+(?:[a-z_]+\.py)?)`", ARCHITECTURE))
    bases = ROOT, ROOT / "skfem_textile"
    assert [p for p in paths if not any((b / p).exists() for b in bases)] == []
    names = set(re.findall(r"`(?:[A-Z]\w+\.)?(_?[A-Za-z]\w{3,})`", ARCHITECTURE))
    assert len(paths) > 30
    assert len(names) > 60
    assert [n for n in names if not re.search(rf"\b{n}\b", CODE)] == []


def test_the_page_on_the_architecture_names_the_modules_of_its_names():
    """`Class.name` in `path`, or `name` (`path`)."""
    place = r"`(?:([A-Z]\w+)\.)?(\w+)`(?: \([^)]*\))?(?: in |,? \()`([a-z_/]+\.py)`"
    places = re.findall(place, ARCHITECTURE)
    assert len(places) > 30
    for *names, path in places:
        bases = (base / path for base in (ROOT, ROOT / "skfem_textile"))
        text = next(file for file in bases if file.exists()).read_text()
        for name in filter(None, names):
            assert re.search(rf"\b{name}\b", text), f"{name} in {path}"
