"""Curves of tests in CSV files."""

import json
import re

import numpy as np
import pytest

from skfem_textile.cli import main as cli
from skfem_textile.cli.curve import read_test_curve
from tests.helpers.command_line import refused

OUT = ("--size", "4x8", "--steps", "2", "--no-render")


def test_columns_are_read_by_their_headings(tmp_path):
    file = tmp_path / "test.csv"
    text = "\ufeffForce (N) , angle (deg)\n\n0,0\n1.5,\n3,20\n"
    file.write_text(text, encoding="utf-8")
    curve = read_test_curve(file)
    assert set(curve) == {"force (N)", "angle (deg)"}
    assert curve["force (N)"].tolist() == [0, 1.5, 3]
    assert np.array_equal(curve["angle (deg)"], [0, np.nan, 20], equal_nan=True)


def test_the_curve_of_a_run_is_such_a_curve(tmp_path):
    out = tmp_path / "out"
    assert cli.main(["run", "bias_extension", "--out", str(out), *OUT]) == 0
    curve = read_test_curve(out / "curve.csv")
    summary = json.loads((out / "summary.json").read_text())
    assert curve["force (N)"][-1] == float(f"{summary['reaction_y']:.12g}")
    numbers = (out / "curve.csv").read_text().split("\n", 1)[1].replace("\n", ",")
    digits = [re.sub(r"e.*|\D", "", x).strip("0") for x in numbers.split(",")]
    assert max(map(len, digits)) == 12
    assert curve["angle (deg)"] == pytest.approx([0, 20, 40])
    moment = 0.5 * np.radians(curve["angle (deg)"])
    expected = moment / np.cos(np.radians(curve["angle (deg)"]))
    assert curve["normalised shear force (N/mm)"] == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("time (s)\n1\n2\n", "row 1: the first row must name columns"),
        ("force (N)\n1\n2\n", "row 1: the header must name"),
        (
            "displacement (mm),force (t)\n0,0\n1,1\n",
            "'force' has the unit 't', which is none of N",
        ),
        ("angle (deg),force (N),force (N)\n0,0,0\n1,1,1\n", "row 1: there are two"),
        ("angle (deg),force (N)\n0,0\n", "at least two rows"),
        ("angle (deg),force (N)\n0,0\n1,one\n", "row 3: '1,one' lacks a finite"),
        ("angle (deg),force (N)\n0,0\n1,inf\n", "row 3: '1,inf' lacks a finite"),
        ("angle (deg),force (N)\n0,0\n1\n", "row 3: '1' lacks a finite number"),
        ("\0\xff", "no CSV file in UTF-8"),
    ],
)
def test_a_file_that_is_no_curve_is_refused_before_a_run(
    tmp_path, capsys, text, message
):
    file = tmp_path / "test.csv"
    file.write_text(text, encoding="latin-1")
    out = ("--out", str(tmp_path / "out"), *OUT)
    said = refused(capsys, "run", "strip", "--test-curve", str(file), *out)
    assert message in said
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_not_there_is_refused(tmp_path, capsys):
    out = ("--out", str(tmp_path / "out"), *OUT)
    said = refused(capsys, "run", "strip", "--test-curve", "no.csv", *out)
    assert "no.csv" in said
