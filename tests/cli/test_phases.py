"""Runs of processes on the command line: files by phase, and repeated phases."""

import csv
import json
import re
from pathlib import Path

import meshio
import numpy as np
import pytest

from skfem_textile.cases import read_result
from skfem_textile.cli.main import main
from skfem_textile.solve.quantities import first_rows

PHASES = """
[scene]
name = "hemisphere_forming"
width_mm = 180
height_mm = 180
radius_mm = 40
part = "quarter"

[mesh]
size = [3, 3]

[[phases]]
name = "lift"
steps = 1
tools.punch.motion_mm = [0, 0, 4]

[[phases]]
name = "press"
steps = 1
tools.punch.motion_mm = [0, 0, 6]
tools.holder.gap_mm = 0.2

[[phases]]
name = "open"
steps = 1
tools.punch.motion_mm = [0, 0, -20]
tools.holder.motion_mm = [0, 0, -30]
"""

SLID = """
[scene]
name = "forming"
width_mm = 140
height_mm = 140
[mesh]
size = [3, 3]
[[tools]]
name = "press"
surface = "plane"
point_mm = [0, 0, 0.3]
side = -1
pressure_N_per_mm2 = 0.001
[[tools]]
name = "stop"
surface = "plane"
point_mm = [0, 0, -9]
[[tools]]
name = "lid"
surface = "plane"
point_mm = [0, 0, 0.3]
side = -1
friction = 0.3
[[phases]]
name = "slide"
steps = 1
tools.lid.motion_mm = [3, 0, 0]
[[phases]]
name = "back"
steps = 1
tools.lid.motion_mm = [0, 0, 0]
"""


def rows(file):
    return [*csv.DictReader(file.read_text(encoding="utf-8").splitlines())]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Folder of a run with a checkpoint, and its case beside it."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "case.toml").write_text(PHASES)
    words = ["run", str(folder / "case.toml"), "--no-render", "--checkpoint"]
    assert main([*words, "--out", str(folder / "out")]) == 0
    return folder


def test_history_and_table_contain_the_phases(run):
    history, table = rows(run / "out" / "history.csv"), rows(run / "out" / "phases.csv")
    assert [row["phase"] for row in history] == ["lift", "lift", "press", "open"]
    assert [row["phase"] for row in table] == ["lift", "press", "open"]
    assert [row["punch_travel_mm"] for row in table] == ["4", "6", "20"]
    assert table[1]["punch_force_N"] == history[2]["punch_force_N"]


def test_the_report_contains_the_table(run, capsys):
    assert main(["report", str(run / "out")]) == 0
    page = (run / "out" / "report.html").read_text(encoding="utf-8")
    assert "<h2>Phases</h2>" in page
    assert "<th>Phase</th><th>lift</th><th>press</th><th>open</th>" in page
    assert ">Punch travel (mm)<" in page
    assert ">Largest draw-in (mm)<" in page
    punch = page[page.index(">Punch force (N)<") :].partition("</tr>")[0]
    assert re.findall(r">\s*([^<>\s]+)\s*<", punch)[-1] == "0"  # not round-off


def test_files_describe_the_ply_before_the_punch_returns(run, capsys):
    """The file of fibres and a read result too; the steps of the whole run count."""
    summary = json.loads((run / "out" / "summary.json").read_text())
    pressed = rows(run / "out" / "history.csv")[2]
    assert summary["punch_travel_mm"] == 6.0
    assert summary["punch_force_N"] == pytest.approx(float(pressed["punch_force_N"]))
    assert summary["load_steps"] == 3
    end = "the end of phase 'press', load factor 0.6667, before the tools open"
    assert summary["described"].startswith(end)
    assert first_rows(summary)[0][0] == "Described"
    read = read_result(run / "out")
    assert read.load_factor == pytest.approx(2 / 3)
    heights = meshio.read(run / "out" / "fibres.vtu").points[:, 2]
    assert np.ptp(read.sheet().positions[2]) == pytest.approx(np.ptp(heights))
    assert np.ptp(heights) > 3.0


@pytest.mark.dear("a run that is read from its checkpoint")
def test_another_phase_is_described(run, tmp_path, capsys):
    again = ["--resume", str(run / "out" / "checkpoint"), "--out", str(tmp_path)]
    words = ["run", str(run / "case.toml"), "--no-render", *again, "--set"]
    assert main([*words, "output.describe=lift"]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["punch_travel_mm"] == 4.0
    assert read_result(tmp_path).load_factor == pytest.approx(1 / 3)
    assert main([*words, "output.describe=open"]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["load_factor"], "described" in summary) == (1.0, False)


def test_results_are_written_whatever_tool_is_the_first(tmp_path, capsys):
    """A holder with a pressure; a lid that slides back and forth does not open."""
    (tmp_path / "case.toml").write_text(SLID)
    words = ["run", str(tmp_path / "case.toml"), "--no-render"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["load_factor"], "described" in summary) == (1.0, False)
    assert summary["reaction_x"] == pytest.approx(summary["lid_force_N"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PHASES, "output.describe: there is no phase 'hold': choose from lift, press"),
        (PHASES.partition("[[")[0], "output.describe requires a case with [[phases]]"),
    ],
)
def test_a_phase_that_is_not_in_the_case_is_not_described(
    tmp_path, capsys, text, message
):
    (tmp_path / "case.toml").write_text(text)
    words = ["--set", "output.describe=hold", "--out", str(tmp_path / "out")]
    assert main(["run", str(tmp_path / "case.toml"), *words]) == 2
    assert message in capsys.readouterr().err


def test_a_run_without_phases_has_no_table(tmp_path, capsys):
    words = "run strip --size 2x2 --steps 1 --no-render --out"
    assert main([*words.split(), str(tmp_path / "out")]) == 0
    assert not (tmp_path / "out" / "phases.csv").exists()
    assert "phase" not in (tmp_path / "out" / "history.csv").read_text()


CHANGED = "phases.press.tools.punch.motion_mm=[0, 0, 5]"


def repeat(run, out, *words, old="out", text=PHASES, change=CHANGED):
    case = out / "other.toml"
    case.write_text(text)
    at = ["--from", str(run / old), "--set", change, *words]
    return main(["run", str(case), "--no-render", "--out", str(out / "new"), *at])


@pytest.mark.dear("a second run between tools")
def test_a_phase_is_repeated_with_another_value(run, tmp_path, capsys):
    before = {file: file.read_bytes() for file in run.rglob("*") if file.is_file()}
    assert repeat(run, tmp_path, "--phase", "press") == 0
    assert all(file.read_bytes() == content for file, content in before.items())
    new, old = (rows(x / "phases.csv") for x in (tmp_path / "new", run / "out"))
    assert new[0] == old[0]
    assert new[1]["punch_force_N"] != old[1]["punch_force_N"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("phases.pres.steps=2", "no table 'pres' in [[phases]], but lift, press"),
        ("phases.press=2", "no table 'press' in [[phases]]"),
        ("phases.press.steps.x=2", "steps is a value, not a table"),
    ],
)
def test_a_key_that_is_not_in_a_phase_is_refused(tmp_path, capsys, change, message):
    assert repeat(tmp_path, tmp_path, "--phase", "press", change=change) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--phase", "press", "--from", "firts"], "--from firts: there is no such fol"),
        ([], "--from and --phase belong together"),
        (["--phase", "pres"], "there is no phase 'pres': choose from lift, press"),
        (["--phase", "press", "--resume"], "omit --from and --phase"),
    ],
)
def test_invalid_repeats_are_refused(run, tmp_path, capsys, words, message):
    assert repeat(run, tmp_path, *words) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_a_folder_without_a_checkpoint_is_refused(run, tmp_path, capsys):
    Path(tmp_path / "empty").mkdir()
    assert repeat(tmp_path, tmp_path, "--phase", "press", old="empty") == 2
    assert (
        "contains no checkpoint: run its case with --check" in capsys.readouterr().err
    )


def test_a_clamp_that_acts_from_the_start_needs_a_new_run(run, tmp_path, capsys):
    clamp = '[[clamps]]\nedge = "right"\nstiffness_N_per_mm = 1\n'
    assert repeat(run, tmp_path, "--phase", "press", text=f"{PHASES}{clamp}") == 2
    assert "differ, from the start: start a new run" in capsys.readouterr().err


def test_another_run_before_the_phase_is_refused(run, tmp_path, capsys):
    other = PHASES.replace("[0, 0, 4]", "[0, 0, 3]")
    assert repeat(run, tmp_path, "--phase", "press", text=other) == 2
    assert "values of the motion of 'punch' differ" in capsys.readouterr().err
