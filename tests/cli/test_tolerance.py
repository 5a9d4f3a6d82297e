"""Runs to a tolerance on the command line."""

import json

import pytest

from skfem_textile.cli.main import main
from tests.helpers.command_line import refused

BIAS = (
    *("bias_extension", "--mesh", "delaunay", "--size", "4x8"),
    *("--steps", "4", "--no-render"),
)


def test_a_run_to_a_tolerance_says_that_it_is_met(tmp_path, capsys):
    assert run(tmp_path, "--tolerance", "0.08") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["tolerance_met"] is True
    assert summary["estimated_load_error"] < 0.08
    assert summary["rounds"][-1]["unknowns"] == summary["n_dofs"]
    assert summary["inputs"]["stepping"]["tolerance"] == 0.08
    printed = capsys.readouterr().out
    assert printed.count("\nrounds ") == len(summary["rounds"])


def test_a_tolerance_that_is_not_met_ends_with_one_and_the_result(tmp_path, capsys):
    most = "--set", "stepping.most_unknowns=1500"
    assert run(tmp_path, "--tolerance", "0.0001", *most) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "with at most 1500 unknowns the tolerance is not met" in line
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["tolerance_met"] is False
    assert summary["converged"] is True
    assert summary["n_dofs"] <= 1500


def run(tmp_path, *options):
    return main(["run", *BIAS, "--out", str(tmp_path / "out"), *options])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--tolerance", "2"), "must be between 0 and 1"),
        (("--tolerance", "nan"), "stepping.tolerance must be a finite number"),
        (
            ("--tolerance", "0.1", "--set", "stepping.most_unknowns=10"),
            "more than the 10",
        ),
        (("--tolerance", "0.1", "--checkpoint"), "cannot have a checkpoint"),
        (("--tolerance", "much"), "--tolerance"),
        (
            ("--set", "stepping.most_unknowns=5000"),
            "stepping.most_unknowns goes with stepping.tolerance",
        ),
    ],
)
def test_bad_tolerances_are_refused_in_one_line(tmp_path, capsys, options, message):
    out = "--out", str(tmp_path / "out")
    assert message in refused(capsys, "run", *BIAS, *out, *options)
    assert not (tmp_path / "out").exists()
