"""The study of a ply in space: problems, tables and outcomes."""

import pytest

from studies.formulations.space import study
from studies.formulations.space.study import STUDY

MEASURED = {"case": "it", "part": "extreme strip", "formulation": "macro"}
MEASURED |= {"E_over_G": 1e4, "D": 1.0}


def test_an_inaccurate_answer_is_wrong_and_a_failure_is_not():
    right = MEASURED | {"outcome": "converged", "off_x": 0.001, "off_z": -0.01}
    inaccurate = right | {"off_z": -0.03}
    refused = MEASURED | {"outcome": "refused", "said": "no"}
    assert study.wrong([right, inaccurate, refused]) == [inaccurate]
    assert "1 wrong" in STUDY.complaint([right, inaccurate, refused])
    assert STUDY.complaint([right, refused]) == ""


def test_each_problem_agrees_with_its_exact_solution():
    kwargs = {"n": 16, "jitter": 0.0, "formulation": "one point"}
    for row in (
        study.cantilever("weight 8", **kwargs, D=1.0, E_over_G=1e4),
        study.shortened(**kwargs, D=1.0, E_over_G=1e4),
        study.hanging_sheet(**kwargs, D=0.0, E_over_G=1e4),
    ):
        assert row["outcome"] == "converged"
        assert abs(row["off_x"]) < 0.01
        assert abs(row["off_z"]) < 0.01
    assert study.plate(45, 16, 0.2, "one point")["off_z"] < 0.02
    assert study.critical("in plane", 8, "one point", 10.0)["off_x"] == pytest.approx(
        0.0, abs=5e-3
    )
    assert study.zero_modes("one point", 1.0)["modes"] == 6
