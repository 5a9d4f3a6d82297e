import csv
import json
from pathlib import Path

import numpy as np
import pytest

from skfem_textile import Full, OnePoint
from studies.__main__ import main
from studies.common.provenance import FILE
from studies.paper import study
from studies.paper.study import Strip
from studies.paper.two_element import report, systems

BY_NAME = {system[:4]: system for system in systems()}
HALF_A_DIGIT = 0.5e-8


@pytest.mark.parametrize(("element", "first"), [("A", "4.1"), ("B", "7.1")])
def test_the_papers_equations_along_x_are_reproduced_to_every_digit(element, first):
    system = BY_NAME["unaligned", "2x2", element, "x"]
    assert system.factor == 1.0, first
    assert np.abs(system.difference).max() < HALF_A_DIGIT


def test_the_papers_equations_along_y_are_reproduced_up_to_a_factor():
    system = BY_NAME["unaligned", "2x2", "A", "y"]
    assert system.factor == 0.4
    assert np.abs(system.difference).max() < HALF_A_DIGIT


def test_one_point_equations_agree_with_the_paper():
    rows = [BY_NAME["unaligned", "one point", e, "x"].rows[0] for e in "AB"]
    np.testing.assert_allclose(rows, [[0.8, -1.2, 0.0], [-1.2, 0.8, -2 / 3]])
    (vertical,) = BY_NAME["unaligned", "one point", "A", "y"].rows
    assert vertical[0] == pytest.approx(vertical[1])  # v3 = -v4


def test_stored_systems_and_slips_are_reproducible():
    file = Path(__file__).parents[2] / "docs" / "paper" / "systems.json"
    computed, stored = report(), json.loads(file.read_text())
    assert computed["slips"] == stored["slips"]
    for system, was in zip(computed["systems"], stored["systems"], strict=True):
        assert system["rank"] == was["rank"]
        assert system["solution"] == pytest.approx(was["solution"], abs=1e-12)
        np.testing.assert_allclose(system["rows"], was["rows"], atol=1e-12)


FEW = [
    Strip("3", "aligned", Full(), "< 2e-6", "none"),
    Strip("11", "irregular", OnePoint(10.0), "1.39e-3", "some"),
    Strip("0", "irregular", OnePoint(0.0), "-", "-"),
]


def test_strips_are_tabled_and_one_that_stops_does_not_stop_the_others(
    tmp_path, capsys, monkeypatch
):
    pytest.importorskip("pyvista")
    monkeypatch.setattr(study, "strips", lambda: FEW)
    out = tmp_path / "out"
    assert main(["paper", "--case", "Fig. *", "--out", str(out)]) == 0
    names = {"paper.csv", "paper.md", "contact_sheet.png", "load_curves.png", FILE}
    assert {file.name for file in out.iterdir()} == names
    with open(out / "paper.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["outcome"] for row in rows] == [
        "stable",
        "stable",
        "no acceptable state beyond load factor 0.000; results there",
    ]
    assert float(rows[1]["load (N)"]) == pytest.approx(-3.49714, rel=1e-5)
    assert (out / "paper.md").read_text().count("\n") == 5
    assert "Fig. 11" in capsys.readouterr().out
