import csv

import numpy as np
import pytest

from skfem_textile import Full, OnePoint
from studies.__main__ import main
from studies.common.provenance import FILE
from studies.paper import study
from studies.paper.study import Strip
from studies.paper.two_element import slips, systems

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


def test_unaligned_elements_lock():
    assert BY_NAME["unaligned", "2x2", "A", "x"].rank == 1
    np.testing.assert_allclose(BY_NAME["unaligned", "2x2", "A", "y"].solution, 0)
    below = BY_NAME["unaligned", "2x2", "B", "x"]
    assert below.rank == 2
    np.testing.assert_allclose(below.solution, 5 / 3)
    np.testing.assert_allclose(below.rows[:, :2] @ below.solution, below.rows[:, 2])


@pytest.mark.parametrize("mesh", ["aligned", "horizontally aligned"])
def test_elements_along_the_warp_shear_independently(mesh):
    for element in "AB":
        system = BY_NAME[mesh, "2x2", element, "x"]
        assert system.rank == 1
        np.testing.assert_allclose(system.rows[:, 2], 0, atol=1e-14)
        np.testing.assert_allclose(system.rows[:, 0], -system.rows[:, 1])
        assert BY_NAME[mesh, "2x2", element, "y"].rank == 2


@pytest.mark.parametrize("mesh", ["unaligned", "aligned", "horizontally aligned"])
def test_one_point_leaves_one_velocity_free(mesh):
    for element in "AB":
        for direction in "xy":
            assert BY_NAME[mesh, "one point", element, direction].rank == 1


def test_one_point_equations_agree_with_the_paper():
    rows = [BY_NAME["unaligned", "one point", e, "x"].rows[0] for e in "AB"]
    np.testing.assert_allclose(rows, [[0.8, -1.2, 0.0], [-1.2, 0.8, -2 / 3]])
    (vertical,) = BY_NAME["unaligned", "one point", "A", "y"].rows
    assert vertical[0] == pytest.approx(vertical[1])  # v3 = -v4


def test_the_listed_errors_are_errors_of_the_paper():
    evidence = " ".join(slip.evidence for slip in slips())
    for number in ("62.50°", "17.6 times", "is 0, at the opposite node 1", "0.4 times"):
        assert number in evidence
    for unlike in ("is 0 as printed, 0.5 as corrected", "4 entries, B_HGL^T 8 rows"):
        assert unlike in evidence


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
