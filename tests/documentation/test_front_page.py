"""README, paper and benchmarks summarise results without changing them."""

import re
from pathlib import Path

import pytest

from studies.figures.pages import BLOCK, BLOCKS

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
BENCHMARKS = (ROOT / "docs" / "benchmarks" / "index.md").read_text()
PAPER = (ROOT / "paper" / "paper.md").read_text()
CONDENSED = {"README": README, "benchmarks": BENCHMARKS, "paper": PAPER}
OUTCOMES = ["right", "other", "refused", "missed", "wrong"]

each_summary = pytest.mark.parametrize("text", CONDENSED.values(), ids=CONDENSED)


def names(text, study):
    """Results of a study in the templates of the blocks of a page, in order."""
    templates = [
        (BLOCKS / f"{name}.md").read_text() for _, name, *_ in BLOCK.findall(text)
    ]
    return re.findall(rf"\{{{study}\.(\S+?)\}}", "".join(templates))


@each_summary
def test_each_of_the_five_outcomes_is_stated_separately(text):
    stated = names(text, "stability")
    assert [name for name in stated if name in OUTCOMES] == OUTCOMES
    assert "cases" in stated
    assert re.search(r"another (stable )?equilibrium", text)


@each_summary
def test_ratios_of_times_are_stated_where_this_library_is_faster_and_where_slower(text):
    ratios = [name for name in names(text, "error_time") if name.endswith("_ratio")]
    assert {name.partition("_")[0] for name in ratios} == {"angle", "load"}
    assert "DOLFINx" in text
    assert "scikit-fem" in text


@pytest.mark.parametrize("text", [BENCHMARKS, PAPER])
def test_the_solvers_of_the_times_are_named(text):
    assert all(name in text for name in ("RSLAB", "SuperLU", "CHOLMOD", "MUMPS"))


def test_the_front_page_is_short():
    assert len(README.split()) <= 650
    assert README.count("<!--") <= 2
    (block,) = BLOCK.findall(README)
    head = 2
    assert block[2].strip().count("\n") + 1 - head <= 6
