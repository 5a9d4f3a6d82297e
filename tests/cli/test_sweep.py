"""The command `sweep`: table, picture, page, interruption and refused values."""

import csv
import re

import pytest

from skfem_textile.cli import main as cli
from skfem_textile.cli import samples
from skfem_textile.scenes import Case
from skfem_textile.sweep import ThisThread
from tests.helpers.command_line import rejected

RUN = [
    *("sweep", "picture_frame", "--size", "2x2", "--steps", "1"),
    *("--solver", "superlu", "--no-render"),
]
VARY = ["--vary", "shear.stiffness_N_per_mm=0.2,0.4", "scene.shear_angle_deg=20,30"]
LOAD = "Load (machine) (N)"


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    """Worker processes take seconds to start."""
    monkeypatch.setattr(samples, "WorkerProcesses", lambda n: ThisThread())


def rows_of(out):
    return list(csv.DictReader((out / "sweep.csv").read_text().splitlines()))


def test_a_sweep_writes_a_table_a_page_and_its_case(tmp_path, capsys):
    out, again = tmp_path / "out", tmp_path / "again"
    assert cli.main([*RUN, *VARY, "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    rows = rows_of(out)
    assert len(rows) == 4
    soft, stiff = (float(rows[i][LOAD]) for i in (0, 2))
    assert stiff == pytest.approx(2 * soft, rel=1e-6)
    assert f"{stiff:.4g}" in printed
    assert printed.splitlines()[0].split("  ")[0] == "Shear stiffness (N/mm)"
    page = re.sub(r"<[^>]+>", " ", (out / "sweep.html").read_text())
    assert "All 4 runs applied the whole load" in page
    assert f"{stiff:.4g}" in page
    command = ["sweep", str(out / "case.toml"), "--no-render", "--out", str(again)]
    assert cli.main(command) == 0
    assert (again / "sweep.csv").read_text() == (out / "sweep.csv").read_text()


def test_options_replace_the_values_of_a_case_file(tmp_path):
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(
        'scene.name = "picture_frame"\nmesh.size = [2, 2]\nstepping.steps = 1\n'
        "[vary]\nscene.shear_angle_deg = [10, 20]\nshear.law = ['linear', 'sin2']\n"
    )
    command = ["sweep", str(case), "--no-render", "--out", str(out)]
    assert cli.main([*command, "--vary", "scene.shear_angle_deg=5,10,15"]) == 0
    rows = rows_of(out)
    assert [row["scene.shear_angle_deg"] for row in rows] == [
        *("5", "5", "10", "10", "15", "15")
    ]
    assert [row["shear.law"] for row in rows[:2]] == ["linear", "sin2"]


def test_an_interrupted_sweep_continues(tmp_path, monkeypatch, capsys):
    out, called, run = tmp_path / "out", [], Case.run

    def interrupted(case):
        called.append(1)
        if len(called) == 3:
            raise KeyboardInterrupt
        return run(case)

    monkeypatch.setattr(Case, "run", interrupted)
    line = [*RUN, *VARY, "--out", str(out)]
    assert cli.main(line) == 130
    assert "the same command continues" in capsys.readouterr().err
    assert len((out / "sweep.jsonl").read_text().splitlines()) == 2
    assert not (out / "sweep.csv").exists()
    assert cli.main(line) == 0
    assert len(called) == 5
    assert len(rows_of(out)) == 4


def test_runs_that_are_refused_are_named_and_stay_in_the_table(
    tmp_path, monkeypatch, capsys
):
    out, run = tmp_path / "out", Case.run

    def refuses(case):
        if case.fabric.shear_law.stiffness == 0.2:
            raise ValueError("it has no room")
        return run(case)

    monkeypatch.setattr(Case, "run", refuses)
    assert cli.main([*RUN, *VARY[:2], "--out", str(out)]) == 1
    line = "shear.stiffness_N_per_mm=0.2: it has no room"
    assert line in capsys.readouterr().err
    first, second = rows_of(out)
    assert (first["reason"], first[LOAD]) == ("it has no room", "")
    assert (second["reason"], float(second["load factor"])) == ("", 1.0)
    page = re.sub(r"\s+", " ", (out / "sweep.html").read_text())
    assert "1 of 2 runs did not apply the whole load" in page


@pytest.mark.slow
@pytest.mark.parametrize("where", ["workers", "scheduler"])
def test_processes_and_dask_compute_the_same_table(where, tmp_path, monkeypatch):
    one, other = tmp_path / "one", tmp_path / "other"
    assert cli.main([*RUN, *VARY, "--out", str(one)]) == 0
    monkeypatch.undo()
    line = [*RUN, *VARY, "--out", str(other)]
    if where == "workers":
        assert cli.main([*line, "--workers", "2"]) == 0
    else:
        distributed = pytest.importorskip("dask.distributed")
        options = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": ":0"}
        with distributed.LocalCluster(processes=True, **options) as cluster:
            assert cli.main([*line, "--scheduler", cluster.scheduler_address]) == 0
    loads = [[float(row[LOAD]) for row in rows_of(out)] for out in (one, other)]
    assert loads[0] == pytest.approx(loads[1], rel=1e-9)


REFUSED = {
    "": "nothing varies: give a key at least two values",
    "--vary scene.shear_angel_deg=1,2": "scene has no key 'shear_angel_deg'; did you",
    "--vary scene.shear_angle_deg=1": "vary.scene.shear_angle_deg must be an array",
    "--vary shear_angle=1,2": "expected KEY=VALUE, such as stepping.steps=5",
    "--vary mesh.seed=1,2 --vary mesh.seed=1,3": "--vary mesh.seed is given twice",
    "--vary scene.name=strip,trellis": "--vary scene.name is not supported",
    "--vary mesh.seed=1,x": "mesh.seed=x: mesh.seed must be an integer",
    "--vary tools.die.friction=0,1": "no table 'die' in [[tools]], which is empty",
    "--vary mesh.seed=1,2 --samples 3": "--samples",
    "--vary mesh.seed=1,2 --tolerance 0.1": "--tolerance does not apply to a sweep",
    "--vary mesh.seed=1,2 --workers 0": "expected a positive integer",
}


@pytest.mark.parametrize("words", REFUSED)
def test_values_that_do_not_fit_are_refused_before_any_work(
    words, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert REFUSED[words] in rejected(capsys, *RUN, "--out", "out", *words.split())
    assert not (tmp_path / "out").exists()


def test_a_sweep_draws_its_three_figures(tmp_path, monkeypatch):
    drawing = pytest.importorskip("skfem_textile.plot.curves")
    drawn = {}
    monkeypatch.setattr(
        drawing,
        "compared_runs",
        lambda values, figures, complete, file: drawn.update(
            values=values, figures=figures, complete=complete
        ),
    )
    line = [word for word in [*RUN, *VARY] if word != "--no-render"]
    assert cli.main([*line, "--out", str(tmp_path / "out")]) == 0
    assert drawn["values"]["Shear angle (°)"] == [20, 30, 20, 30]
    names = [LOAD, "Largest shear angle (°)", "Wrinkle risk (%)"]
    assert [*drawn["figures"]] == names
    assert drawn["complete"].all()
