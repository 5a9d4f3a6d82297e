"""Runs of the command line, for tests."""

import json
import os
from functools import partialmethod
from pathlib import Path

import numpy as np

from skfem_textile import LoadStepper, Ply
from skfem_textile.cli import main as cli

ROOT = Path(__file__).parents[2]
MESH = ROOT / "examples" / "meshes" / "strip.msh"

#: Environment of a child process that imports this checkout.
OF_CHILD = {**os.environ, "PYTHONPATH": str(ROOT)}

#: A run that takes a moment and draws its pictures, which take seconds.
DRAWN = [
    *("--size", "2x3", "--steps", "3", "--shear-stiffness", "1"),
    *("--set", "formulation.cs_N_per_mm=10"),
]

#: A run that takes a moment.
QUICK = [*DRAWN, "--no-render"]


def run(tmp_path, *arguments):
    return cli.main(["run", "strip", "--out", str(tmp_path / "out"), *arguments])


def stop_early(monkeypatch):
    """Reject every displacement of more than 10 mm, with few shorter increments."""

    def area_ratio(ply, u):
        return 10 - abs(u).max() * np.ones(ply.mesh.nelements)

    monkeypatch.setattr(Ply, "least_area_ratio", area_ratio)
    few = partialmethod(LoadStepper.__init__, max_halvings=1)
    monkeypatch.setattr(LoadStepper, "__init__", few)


def summary_in(out):
    return json.loads((out / "summary.json").read_text())


def computed(out, scene, *words):
    """Summary of a run that succeeds; each word may be several options."""
    options = [option for word in words for option in word.split()]
    assert cli.main(["run", scene, "--out", str(out), *options]) == 0
    return summary_in(out)


def fit(kind, *words, draw=False):
    """Fit without pictures; each word may be several options."""
    options = [option for word in words for option in str(word).split()]
    quiet = [] if draw else ["--no-render"]
    assert cli.main(["fit", kind, *options, *quiet]) == 0


def rejected(capsys, *arguments, warnings=0):
    """The one line with which invalid input is rejected, after a number of warnings."""
    try:
        code = cli.main(arguments)
    except SystemExit as end:
        code = end.code
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1 + warnings
    return err


def is_whole(out):
    """True if the files listed in a summary exist, or there is no summary."""
    if not (out / "summary.json").exists():
        return True
    steps = json.loads((out / "summary.json").read_text())["load_steps"]
    rows = (out / "history.csv").read_text().count("\n") - 1
    files = list((out / "fields").glob("step_*.vtu"))
    return rows == len(files) == steps + 1
