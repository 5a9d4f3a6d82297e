"""README, paper and benchmarks summarise results without changing them."""

import re
from pathlib import Path

import pytest

from studies.figures.pages import markers

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
BENCHMARKS = (ROOT / "docs" / "benchmarks" / "index.md").read_text()
PAPER = (ROOT / "paper" / "paper.md").read_text()
CONDENSED = {"README": README, "benchmarks": BENCHMARKS, "paper": PAPER}
OUTCOMES = ["right", "other", "refused", "missed", "wrong"]


def rows(text):
    """Lines of the tables of a page, without headers."""
    return [line for line in text.splitlines() if re.match(r"\| (?!question|--)", line)]


@pytest.mark.parametrize("text", CONDENSED.values(), ids=CONDENSED)
def test_each_of_the_five_outcomes_is_stated_separately(text):
    names = [name for study, name, _ in markers(text) if study == "stability"]
    assert [name for name in names if name in OUTCOMES] == OUTCOMES
    assert "cases" in names
    assert re.search(r"another (stable )?equilibrium", text)


@pytest.mark.parametrize("text", CONDENSED.values(), ids=CONDENSED)
def test_ratios_of_times_are_stated_at_several_errors_of_one_quantity_each(text):
    """A shape within 0.1° and a load within 1 N are separate criteria."""
    ratios = [n for study, n, _ in markers(text) if study == "error_time"]
    ratios = [name for name in ratios if name.endswith("_ratio")]
    criteria = {name.partition("_")[0] for name in ratios}
    assert criteria == {"angle", "load"}
    for criterion in criteria:
        errors = {n.split("_")[1] for n in ratios if n.startswith(criterion)}
        assert len(errors) >= 2
    assert "rms error" in text
    assert "error of the load" in text


@pytest.mark.parametrize("text", CONDENSED.values(), ids=CONDENSED)
def test_both_sets_of_solvers_are_named_with_the_times(text):
    assert "SuperLU" in text
    assert "CHOLMOD" in text
    assert "MUMPS" in text


def test_the_front_page_has_at_most_ten_results_and_links_the_benchmarks_first():
    assert len(rows(README)) <= 10
    pages = re.findall(r"\]\((docs/[\w/-]+\.md)", README)
    assert pages[0] == "docs/benchmarks/index.md"
