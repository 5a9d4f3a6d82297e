"""Curves of tests from CSV files."""

import numpy as np
import pytest

from skfem_textile.calibration import BiasExtension, read_curve, read_specimen


def written(tmp_path, text):
    file = tmp_path / "test.csv"
    file.write_text(text)
    return file


def test_columns_come_in_any_order_with_their_units(tmp_path):
    header = "Load (kN),time (s), Angle [deg],extension [ cm ]\n"
    found = read_curve(written(tmp_path, f"{header}1,2,90,4\n"))
    assert set(found) == {"force", "shear angle", "displacement"}
    assert found["force"].tolist() == [1000.0]
    assert found["displacement"].tolist() == [40.0]
    assert found["shear angle"] == pytest.approx([np.pi / 2])


def test_units_that_are_given_count_more_than_those_of_the_file(tmp_path):
    file = written(tmp_path, "displacement,force (N)\n1,2\n")
    found = read_curve(file, {"displacement": "m", "force": "kN"})
    assert found["displacement"].tolist() == [1000.0]
    assert found["force"].tolist() == [2000.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the file is empty"),
        ("displacement,force (N)\n1,2\n", "'displacement' has no unit"),
        ("force (pound)\n1\n", "has the unit 'pound', which is none of N"),
        (
            "time (s)\n1\n",
            "row 1: the first row must name columns, and none is one of disp",
        ),
        ("force (N),load (N)\n1,2\n", "two columns 'force'"),
        ("force (N);extension (mm)\n1;2\n", "are separated by semicolons"),
        ("force [N]\textension [mm]\n1\t2\n", "are separated by tabs"),
        ("force (N),displacement (mm)\n", "there are no points"),
        ("force (N),displacement (mm)\n1,2\n1\n", "row 3: '1' lacks a finite number"),
        ("force (N),displacement (mm)\nnan,2\n", "row 2: 'nan,2' lacks a finite"),
        ("force (N),displacement (mm)\n1e200,2\n", "finite number below 1e"),
        ("displacement (mm)\n1\n", "no column 'force'"),
        ("force (N)\n1\n", "no column 'displacement' or 'shear angle'"),
    ],
)
def test_what_is_no_test_is_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(ValueError, match=said) as told:
        read_specimen(written(tmp_path, text), BiasExtension(50.0, 100.0))
    assert "\n" not in str(told.value)
    assert "test.csv" in str(told.value)
