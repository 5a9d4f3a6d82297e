"""Commands of pages give the numbers that the pages state."""

import re
from pathlib import Path

import pytest

from studies.commands.documented import DOCUMENTED, IMPORTS, STRETCHED, Documented
from studies.commands.study import STUDY

ROOT = Path(__file__).parents[2]
STORED = ROOT / "docs" / "commands"


def in_one_line(text):
    return " ".join(text.split())


def with_includes(page):
    """The text of a page with the tables that it includes."""

    def included(match):
        return (page.parent / match[1]).read_text(encoding="utf-8")

    text = page.read_text(encoding="utf-8")
    return re.sub(r"^\[Table: [^\]]+\]\((\S+)\)$", included, text, flags=re.M)


@pytest.mark.parametrize("name", DOCUMENTED)
def test_a_command_of_a_page_runs_unchanged(name):
    case = DOCUMENTED[name]
    assert in_one_line(case.command) in in_one_line(with_includes(ROOT / case.page))


@pytest.mark.parametrize("name", [x for x in DOCUMENTED if not DOCUMENTED[x].python])
def test_words_in_capitals_have_values(name):
    case = DOCUMENTED[name]
    words = set(re.findall(r"(?<!\S)[A-Z]+(?!\S)", case.command))
    assert words <= {"DIR", *case.given}
    assert not words & set(case.line.split())


def test_imports_of_python_lines_are_on_their_pages():
    pages = [
        with_includes(ROOT / case.page) for case in DOCUMENTED.values() if case.python
    ]
    assert [
        x for x in IMPORTS.splitlines() if not any(x in page for page in pages)
    ] == []


@pytest.fixture(scope="module")
def stored():
    return STUDY.stored(STORED)


def test_a_command_gives_its_stored_result(stored):
    """`python -m studies figures --check` runs the script of the strip."""
    name = "load of a bias extension"
    rows = [row for row in stored if row["case"] == name]
    for row, was in zip(STUDY.examine(name), rows, strict=True):
        assert row["quantity"] == was["quantity"]
        assert row["value"] == pytest.approx(was["value"], rel=1e-3, abs=1e-6)


def test_a_mesh_along_the_fibres_needs_quadratic_triangles(stored):
    """The error of macro-elements is half a millimetre there, as my-mesh.md states."""
    data = {(row["case"], row["quantity"]): row["value"] for row in stored}
    error = {
        name: data[f"mesh along the fibres, {name}, E = 1e5", "displacement_error_max"]
        for name in ("quadratic", "full", "macro")
    }
    assert max(error["quadratic"], error["full"]) < 0.02 < 0.5 < error["macro"] < 0.6


def test_one_point_elements_have_a_larger_error_than_locking_ones(stored):
    """The picture of the strip states it beside the strains."""
    words = STUDY.figures(stored)
    assert words["strip_position_point"] == "0.206 mm"
    assert words["strip_position_full"] == "0.060 mm"
    assert words["strip_force_full"] == "−148 N"


def test_estimates_of_the_load_lost_to_fibre_stretch_are_within_a_third(stored):
    values = {(row["case"], row["quantity"]): row["value"] for row in stored}
    for name in STRETCHED:
        measured = values[name, "measured"]
        assert values[name, "estimate"] == pytest.approx(measured, rel=1 / 3), name


def test_commands_find_the_files_offered_by_their_page():
    folders = []

    def read(folder, printed):
        folders.extend(printed.split())
        return {}

    Documented("docs/tutorial/index.md", "ls", read).results()
    assert {"coupon.msh", "shear.csv", "whole.py", "examples"} <= set(folders)
