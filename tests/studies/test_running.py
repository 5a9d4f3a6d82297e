"""Studies are listed, selected, interrupted, killed and resumed."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from studies import __main__
from studies.common.tables import rows_of_csv
from studies.study import Part, Study, descriptions, load

ROOT = Path(__file__).parents[2]


class Squares(Study):
    """A minimal study."""

    parts = (Part("squares.csv"),)
    shown = "{number} squared is {square}"

    def add_options(self, parser):
        parser.add_argument("--bad", type=int, default=-1)

    def cases(self, options):
        self.bad = options.bad
        return [1, 2, 3]

    def name(self, case):
        return f"square of {case}"

    def examine(self, case):
        return [{"number": case, "square": case**2, "process": os.getpid()}]

    def complaint(self, rows):
        bad = [row for row in rows if row["square"] == self.bad]
        return f"{len(bad)} are bad" if bad else ""


@pytest.fixture
def squares(monkeypatch, tmp_path):
    """Runs the study with further words; returns the exit code."""
    monkeypatch.setattr(__main__, "descriptions", lambda: {"squares": "Squares"})
    monkeypatch.setattr(__main__, "load", lambda name: Squares())
    return lambda *words: __main__.main(["squares", "--out", str(tmp_path), *words])


def test_studies_are_listed_with_their_summaries(capsys):
    assert __main__.main([]) == 0
    output = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in output]
    assert {"paper", "formulations", "stability", "error_time", "speed"} <= set(names)
    assert names == list(descriptions())
    assert all(isinstance(load(name), Study) for name in names)


def test_listing_imports_no_study():
    script = (
        "import sys; from studies.study import descriptions; descriptions(); "
        "print([m for m in sys.modules if m in ('numpy', 'skfem_textile')])"
    )
    child = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, check=True
    )
    assert child.stdout.strip() == b"[]"


def test_every_case_is_examined_and_reported(squares, tmp_path, capsys):
    assert squares() == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:-1] == [f"square of {n}: {n} squared is {n * n}" for n in (1, 2, 3)]
    assert {p.name for p in tmp_path.iterdir()} == {"squares.csv", "provenance.json"}
    assert (tmp_path / "squares.csv").read_bytes().count(b"\n") == 4


def test_results_contain_their_origin(squares, tmp_path):
    squares("--bad", "5")
    (run,) = json.loads((tmp_path / "provenance.json").read_text())["squares"]
    assert run["options"] == {"bad": 5}
    assert re.fullmatch("[0-9a-f]{40}", run["commit"])
    assert run["packages"]["numpy"] == np.__version__
    some = {"bad": -1, "case": ["square of 1"]}
    squares("--case", "square of 1")
    runs = json.loads((tmp_path / "provenance.json").read_text())["squares"]
    assert [one["options"] for one in runs] == [{"bad": 5}, some]
    squares()  # replaces the runs with its options, of all cases or some
    runs = json.loads((tmp_path / "provenance.json").read_text())["squares"]
    assert [one["options"] for one in runs] == [{"bad": 5}, {"bad": -1}]


def test_a_run_of_some_cases_does_not_change_the_others(squares, tmp_path):
    squares()
    file = tmp_path / "squares.csv"
    file.write_text(file.read_text().replace("square of 3,3,9", "square of 3,3,-9"))
    squares("--case", "square of 2")
    squared = [row["square"] for row in rows_of_csv(file.read_text())]
    assert squared == [1, 4, -9]


def test_cases_are_chosen_by_name(squares, capsys):
    assert squares("--case", "* 3", "square of 1") == 0
    names = [line.partition(":")[0] for line in capsys.readouterr().out.splitlines()]
    assert names[:-1] == ["square of 1", "square of 3"]


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (("--case", "cube"), "no case matches cube; available: square of 1, "),
        (("--workers", "0"), "'0' is not a positive integer"),
        (("--bad", "x"), "invalid int value: 'x'"),
    ],
)
def test_bad_input_is_rejected_in_one_line(squares, tmp_path, capsys, words, answer):
    try:
        code = squares(*words)
    except SystemExit as end:
        code = end.code
    assert code == 2
    stderr = capsys.readouterr().err
    assert answer in stderr
    assert stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_study_may_report_a_complaint(squares, capsys):
    assert squares("--bad", "4") == 1
    assert "1 are bad" in capsys.readouterr().err


def test_a_study_whose_cases_are_timed_has_no_workers(squares, monkeypatch, capsys):
    monkeypatch.setattr(Squares, "timed", True)
    with pytest.raises(SystemExit):
        squares("--workers", "2")
    assert "--workers" in capsys.readouterr().err


def test_a_study_with_a_failing_case_or_an_interruption_is_resumed(
    squares, tmp_path, monkeypatch, capsys
):
    """The other cases are reported, and the end equals an undisturbed run."""
    examine, examined = Squares.examine, []
    errors = [ValueError("3"), ValueError("3"), KeyboardInterrupt()]

    def disturbed(study, case):
        examined.append(case)
        if case == 3 and errors:
            raise errors.pop(0)
        return examine(study, case)

    monkeypatch.setattr(Squares, "examine", disturbed)
    assert squares() == 1
    stderr = capsys.readouterr().err
    assert "square of 3: " in stderr
    assert "--resume" in stderr
    assert (tmp_path / "squares.csv").read_bytes().count(b"\n") == 3
    assert squares() == 2
    assert "--resume" in capsys.readouterr().err
    assert squares("--resume") == 130
    assert squares("--resume") == 0
    assert examined.count(1) == examined.count(2) == 1
    resumed = (tmp_path / "squares.csv").read_bytes()
    assert {p.name for p in tmp_path.iterdir()} == {"squares.csv", "provenance.json"}
    assert squares() == 0
    assert (tmp_path / "squares.csv").read_bytes() == resumed
