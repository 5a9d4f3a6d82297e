"""Studies are listed, selected, interrupted, killed and resumed."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from studies import __main__
from studies.common.tables import rows_of_csv
from studies.study import Part, Study, descriptions, load
from tests.helpers.sweep_cases import is_alive, wait_until

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


STUDY = """
import os, sys, time
from pathlib import Path
from skfem_textile import Full
from studies import __main__
from studies.stability import study
from studies.stability.problems import Extreme
from studies.stability.study import RIGHT

study.extremes = lambda: [Extreme("family", n, None, Full()) for n in "abcd"]

def examine(_, problem):
    with open(problem.label, "a") as file:
        file.write(f"{os.getpid()} ")
    while problem.label == "b" and not Path("go on").exists():
        time.sleep(0.01)
    figures = {"family": problem.family, "problem": problem.name, "steps": 1}
    figures |= {"kind": problem.kind, "seed": None, "outcome": RIGHT}
    figures |= {"solvable": True, "agrees": True, "path_resolved": True}
    return [figures | {"linear_solves": ord(problem.label), "energy": 0.1}]

study.Stability.examine = examine

if __name__ == "__main__":
    sys.exit(__main__.main(["stability", "--no-render", *sys.argv[1:]]))
"""


def test_a_killed_study_is_resumed_with_the_same_report(tmp_path):
    (tmp_path / "study.py").write_text(STUDY)
    command = [sys.executable, "study.py", "--out"]
    options = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(ROOT)}}
    part = tmp_path / "killed" / "stability-unfinished.jsonl"
    started = tmp_path / "b"
    two = "--workers", "2"
    with subprocess.Popen([*command, "killed", *two], **options) as study:
        wait_until(lambda: started.is_file() and started.read_text().endswith(" "))
        wait_until(lambda: part.is_file() and len(part.read_text().splitlines()) == 3)
        study.send_signal(signal.SIGKILL)
    (left,) = {int(pid) for pid in started.read_text().split()}
    wait_until(lambda: not is_alive(left))
    (tmp_path / "go on").touch()
    subprocess.run([*command, "killed", "--resume"], **options, check=True)
    runs = [len((tmp_path / name).read_text().split()) for name in "abcd"]
    assert runs == [1, 2, 1, 1]
    assert not part.exists()
    subprocess.run([*command, "whole"], **options, check=True)
    files = [p.name for p in (tmp_path / "whole").iterdir()]
    assert len(files) == 3
    for name in files:
        ours, theirs = (tmp_path / d / name for d in ("killed", "whole"))
        assert ours.read_bytes() == theirs.read_bytes()
