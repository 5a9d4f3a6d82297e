"""The study of refinement: its references, its tables, and one case of each task."""

import pytest

from skfem_textile import Linear
from studies.adaptive.cases import Case, all_cases
from studies.adaptive.study import STUDY, Adaptive
from studies.adaptive.tables import estimates, factor, kinks, tolerances
from studies.angles.cases import G


def test_every_case_of_a_load_has_a_reference():
    loads = {
        case: case.reference(case.scene())
        for case in all_cases()
        if case.task != "kinks" and case.across < 8
    }
    for case, load in loads.items():
        scene = case.scene()
        lost = scene.load_lost(case.ply(scene).fabric, 1.0)
        assert load == pytest.approx(scene.load(Linear(G), 1.0) * (1 - lost), rel=0.01)


def test_a_case_has_an_error_and_an_estimate():
    (row,) = STUDY.examine(Case("judges", 45, 20.0, 1e5, "irregular", 4))
    assert 0 < abs(row["error"]) < 0.1
    assert 0.5 < row["estimate"] / abs(row["error"]) < 3
    assert row["cost"] > 0
    assert "estimate" in Adaptive().line([row])


def row(task, error, estimate, **more):
    given = {"task": task, "error": error, "estimate": estimate, "case": task}
    return given | {"cost": 0.2, "met": True, "unknowns": 10, "at": 1.0} | more


def test_tables_count_what_passes():
    rows = [row("judges", 0.01, x) for x in (0.004, 0.006, 0.02, 0.04, None)]
    rows += [row("judges", 0.001, x) for x in (0.019, 0.021)]
    assert "| judges | 2 of 5 | 1 of 2 |" in estimates(rows)
    rows = [row("tolerance", *x) for x in ((0.009, 0.008), (-0.02, 0.005))]
    rows.append(row("tolerance", 0.02, 0.03, met=False))
    assert tolerances(rows).startswith("Of 3 runs to 1%, 2 say that they met it, and 1")
    angles = {"angle_error": 2.0, "angle_estimate": 2.6}
    assert "| load | 1.00 |" in factor([row("calibrates", 0.01, 0.02, **angles)])
    uniform = [(100, 0.4), (400, 0.2)]
    own = [
        {"task": "kinks", "degrees": 45.0, "mesh": kind, "unknowns": n}
        | {"position_error": error, "over_area": error**2}
        for kind, pairs in (("uniform", uniform), ("refined", [(200, 0.1)]))
        for n, error in pairs
    ]
    assert "| 0.1000 | 0.2828 | 0.35 | 0.0100 | 0.0800 | 0.12 |" in kinks(own)
