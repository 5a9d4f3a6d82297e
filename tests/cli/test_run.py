"""Files and messages of a run, runs to a tolerance, and resumed runs."""

import io
import json
import sys
from pathlib import Path
from time import sleep

import numpy as np
import pytest

from skfem_textile import Result
from skfem_textile.cli import results
from skfem_textile.cli.main import main
from skfem_textile.mesh import progress
from skfem_textile.solve.stepper import Run
from tests.helpers.command_line import (
    QUICK,
    is_whole,
    rejected,
    run,
    stop_early,
    summary_in,
)

# Output of a run, interruption and resumption


def test_a_run_writes_summary_history_and_fields(tmp_path, capsys):
    assert run(tmp_path, *QUICK, "--shear-stiffness", "0.5") == 0
    out = tmp_path / "out"
    assert {p.name for p in out.iterdir()} == {
        *("summary.json", "history.csv", "curve.csv", "case.toml", "fields"),
        *("fibres.vtu", "fibres.csv", "fibres.inp"),
    }
    summary = summary_in(out)
    assert set(summary) == {
        *("scene", "formulation", "n_elements", "n_dofs", "converged", "load_factor"),
        *("load_steps", "linear_solves", "energy", "tension_energy", "shear_energy"),
        *("corners_energy", "stabilisation_energy", "path_resolved", "inputs"),
        *("max_fibre_strain", "mesh_fibre_strain", "max_fibre_tension", "min_det_F"),
        *("max_shear_angle_deg", "wall_time_s", "assembly_time_s", "solve_time_s"),
        *("load_N", "load_N_half_width", "displacement_mm", "first", "versions"),
        *("wrinkle_risk_share_of_area", "wrinkle_risk_at_x_mm", "wrinkle_risk_at_y_mm"),
        *("max_shear_angle_at_x_mm", "max_shear_angle_at_y_mm", "default_fabric"),
        *("reaction_x", "reaction_y", "displacement_error_rms", "stable"),
        *("displacement_error_max", "shear_angle_error_rms_deg", "negative_pivots"),
        *("steps_cut", "factorisations", "solver", "solver_reason", "load_half_width"),
        *("shear_angle_error_deg", "error_interval"),
        *(
            f"{whole}_share_of_{role}"
            for whole in ("energy", "work", "reaction")
            for role in ("stabilisation", "deviation")
        ),
    }
    assert summary["inputs"]["formulation"]["cs_N_per_mm"] == 10.0
    assert summary["inputs"]["mesh"]["size"] == [2, 3]
    assert summary["scene"] == "strip"
    assert summary["formulation"] == "macro"
    assert summary["converged"] is True
    assert summary["n_elements"] == 4 * 6
    assert summary["shear_energy"] > 0
    assert is_whole(out)
    own = list((out / "fields").glob("own_step_*.vtu"))
    assert len(own) == summary["load_steps"] + 1
    printed = capsys.readouterr().out
    assert "Largest fibre strain" in printed
    assert "max_fibre_strain" not in printed


def interrupt_at(monkeypatch, number):
    """Interrupt the command line after this many states, the initial one included."""
    keep = Run._append

    def interrupt(run, *arguments):
        if len(run.states) == number:
            raise KeyboardInterrupt
        keep(run, *arguments)

    monkeypatch.setattr(Run, "_append", interrupt)


def test_an_interruption_before_any_state_is_reported(tmp_path, capsys, monkeypatch):
    interrupt_at(monkeypatch, 0)
    assert run(tmp_path, *QUICK) == 130
    assert capsys.readouterr().err == "skfem-textile: interrupted\n"
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def checkpointed(tmp_path_factory):
    """Folders of a run and of its checkpoint."""
    folder = tmp_path_factory.mktemp("checkpointed")
    assert run(folder, *QUICK, "--checkpoint", str(folder / "c")) == 0
    return folder / "out", folder / "c"


def test_an_interrupted_run_is_saved_and_resumed(
    tmp_path, checkpointed, capsys, monkeypatch
):
    out = tmp_path / "out"
    whole = (checkpointed[0] / "history.csv").read_text()
    with monkeypatch.context() as patch:
        interrupt_at(patch, 2)
        assert run(tmp_path, *QUICK, "--checkpoint") == 130
    stderr = capsys.readouterr().err
    assert stderr.count("\n") == 1
    written = "the last converged state, at load factor 0.333333, is written"
    assert f"interrupted: {written}; --resume continues the run from" in stderr
    assert summary_in(out)["load_factor"] == pytest.approx(1 / 3)
    first = whole.splitlines(keepends=True)[:3]
    assert (out / "history.csv").read_text() == "".join(first)
    again = "run", "strip", "--out", str(out), *QUICK, "--checkpoint"
    assert "resume" in rejected(capsys, *again)
    assert run(tmp_path, *QUICK, "--resume", "-v") == 0
    assert "resumed at load factor 0.333333" in capsys.readouterr().err
    assert (out / "history.csv").read_text() == whole


def test_a_checkpoint_in_any_folder_is_rejected_by_another_run(
    tmp_path, checkpointed, capsys
):
    out, folder = checkpointed
    assert not (out / "checkpoint").exists()
    again = ("--resume", str(folder), "--fibre-stiffness", "2e4")
    command = ("run", "strip", "--out", str(tmp_path / "new"), *QUICK, *again)
    assert "belongs to another run: warp law was Linear" in rejected(capsys, *command)
    assert not (tmp_path / "new").exists()


def test_numbers_that_json_cannot_represent_are_null(tmp_path, monkeypatch):
    summary = Result.summary
    odd = {"energy": np.inf, "stable": np.nan, "load_steps": 1e308}
    monkeypatch.setattr(Result, "summary", lambda *of: summary(*of) | odd)
    assert run(tmp_path, *QUICK) == 0

    def refuse(constant):
        raise ValueError(constant)

    text = (tmp_path / "out" / "summary.json").read_text()
    computed = json.loads(text, parse_constant=refuse)
    assert (computed["energy"], computed["stable"]) == (None, None)
    assert computed["load_steps"] == 1e308


def test_steps_and_iterations_are_logged_on_request(tmp_path, capsys):
    """With a fixed C_s every linear solve is an iteration."""
    lines = []
    for verbose in ("-v", "-vv"):
        assert run(tmp_path, *QUICK, "--formulation", "one-point", verbose) == 0
        lines.append(capsys.readouterr().err.splitlines())
    summary = summary_in(tmp_path / "out")
    solver, *states = lines[0]
    assert solver.startswith("linear solver ")
    assert len(states) == summary["load_steps"] + 1
    assert len(lines[1]) == len(lines[0]) + summary["linear_solves"]
    assert "N, tolerance" in lines[1][2]


def test_a_run_that_stops_early_keeps_its_last_state(tmp_path, capsys, monkeypatch):
    stop_early(monkeypatch)
    assert run(tmp_path, *QUICK) == 1
    summary = summary_in(tmp_path / "out")
    assert summary["converged"] is False
    assert 0 < summary["load_factor"] < 1
    fields = sorted((tmp_path / "out" / "fields").glob("step_*.vtu"))
    assert len(fields) == summary["load_steps"] + 1
    out, err = capsys.readouterr()
    at = f"at load factor {summary['load_factor']:.4g}"
    assert out.startswith(f"Stopped early           {at}, described here")
    assert err.startswith("skfem-textile: stopped at load factor")


def test_a_second_run_into_a_folder_is_rejected_first(tmp_path, capsys, monkeypatch):
    keep, codes = Run._append, []

    def second(first, *arguments):
        keep(first, *arguments)
        if not codes:
            codes.append(None)
            codes[0] = run(tmp_path, *QUICK)

    monkeypatch.setattr(Run, "_append", second)
    assert run(tmp_path, *QUICK) == 0
    assert codes == [2]
    stderr = capsys.readouterr().err
    assert stderr.count("\n") == 1
    assert f"another run is writing to {tmp_path / 'out'}" in stderr


def test_a_folder_of_any_name_is_reported_in_one_line(tmp_path, capsys, monkeypatch):
    """Also on a terminal that knows ASCII only."""
    stdout = io.TextIOWrapper(io.BytesIO(), "ascii")
    monkeypatch.setattr(sys, "stdout", stdout)
    out = tmp_path / "a\nb \udcff ü"
    assert main(["run", "strip", *QUICK, "--out", str(out)]) == 0
    assert (out / "summary.json").exists()
    *_, line = stdout.buffer.getvalue().splitlines()
    assert line.startswith(b"results written to ")
    assert capsys.readouterr().err == ""


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_of_long_parts_is_shown_on_a_terminal(tmp_path, monkeypatch):
    pytest.importorskip("pyvista")
    monkeypatch.setenv(progress.SWITCH, "")
    monkeypatch.setenv("TERM", "xterm")
    for name in ("_DELAY", "_REFRESH"):
        monkeypatch.setattr(progress, name, 0.001)
    monkeypatch.setattr(results, "draw", lambda *_: sleep(0.1))
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    line = "run trellis --size 4x4 --steps 2 --out"
    assert main([*line.split(), str(tmp_path / "out")]) == 0
    shown = terminal.getvalue()
    for part in ("preparing the case", ", iteration ", "estimating", "drawing pict"):
        assert part in shown
    assert shown.endswith("\r")


# Runs to a tolerance on the command line


BIAS = "bias_extension", "--mesh delaunay --size 2x4 --steps 1 --no-render"


def run_to_tolerance(out, scene, *options):
    """Exit code and summary of a run; each option may be several."""
    words = [word for option in options for word in option.split()]
    code = main(["run", scene, "--out", str(out), *words])
    return code, summary_in(out)


def test_a_run_to_a_tolerance_reports_that_it_is_met(tmp_path, capsys):
    """A mesh of another kind has more and more elements along each side."""
    code, summary = run_to_tolerance(tmp_path, *BIAS, "--tolerance 0.2 --mesh-as-is")
    assert code == 0
    assert summary["tolerance_met"] is True
    assert summary["load_half_width"] < 0.2
    assert len(summary["rounds"]) > 1
    assert summary["rounds"][-1]["unknowns"] == summary["n_dofs"]
    assert summary["rounds"][-1]["half_width"] == summary["load_half_width"]
    assert summary["inputs"]["stepping"]["tolerance"] == 0.2
    assert summary["inputs"]["mesh"]["size"] == [2, 4]
    printed = capsys.readouterr().out
    met = f"20 % of the load: met on mesh {len(summary['rounds'])}"
    assert met in printed


HOLE = Path(__file__).parents[2] / "examples" / "meshes" / "hole.msh"


@pytest.mark.parametrize(
    ("scene", "options", "source"),
    [
        ("bias_extension", "--mesh graded --density 0.25 --tolerance 0.008", "graded"),
        ("specimen", f"--mesh {HOLE} --fibres 45 --tolerance 0.5", "hole.msh"),
    ],
)
def test_graded_meshes_are_made_denser(tmp_path, scene, options, source):
    """They also replace the mesh of a file."""
    few = "--steps 1 --no-render"
    code, summary = run_to_tolerance(tmp_path, scene, options, few)
    assert code == 0
    assert summary["tolerance_met"] is True
    assert summary["formulation"] == "quadratic"
    assert summary["inputs"]["mesh"]["source"].endswith(source)
    unknowns = [one["unknowns"] for one in summary["rounds"]]
    assert unknowns == sorted(set(unknowns))
    if source == "graded":
        assert len(unknowns) > 1


def test_a_tolerance_that_is_not_met_gives_exit_code_1_and_the_result(tmp_path, capsys):
    most = "--tolerance 0.0001 --set stepping.most_unknowns=150"
    code, summary = run_to_tolerance(tmp_path, *BIAS, most)
    assert code == 1
    *_, line = capsys.readouterr().err.splitlines()
    assert "the tolerance is not met with at most 150 unknowns" in line
    assert summary["tolerance_met"] is False
    assert summary["converged"] is True
    assert summary["n_dofs"] <= 150
