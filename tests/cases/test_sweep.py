"""Sweeps of a case over values of its keys."""

import csv
import logging
import re
from dataclasses import replace

import numpy as np
import pytest

from skfem_textile.cases import (
    CaseFileError,
    case_from_tables,
    declared,
    read_tables,
    sweep_case,
)
from skfem_textile.cases.read import varied, with_value
from skfem_textile.cases.sweep import (
    REACHED,
    REASON,
    CaseSweep,
    _value_at,
    axis_of,
    legible,
    resolved_case,
    run_variants,
    variants,
)
from skfem_textile.cases.write import case_text
from skfem_textile.declarations import words
from skfem_textile.scenes import Case
from skfem_textile.solve.result import StepError
from tests.helpers import refused

FRAME = {
    "scene": {"name": "picture_frame"},
    "mesh": {"size": (2, 2)},
    "stepping": {"steps": 1, "solver": "superlu"},
}
STIFFNESS, ANGLE = "shear.stiffness_N_per_mm", "scene.shear_angle_deg"
LOAD = "Load (machine) (N)"

PUNCH = {"name": "punch", "surface": "sphere", "radius_mm": 30, "motion_mm": [0, 0, 4]}
HOLDER = {
    "name": "holder",
    "surface": "plane",
    "point_mm": [0, 0, 0.2],
    "side": -1,
    "force_N": 2.0,
    "compaction": {
        "law": "compaction",
        "thickness_mm": 0.3,
        "pressure_N_per_mm2": 1e-3,
        "exponent": 8,
    },
}
FORMING = {
    "scene": {"name": "forming", "width_mm": 120, "height_mm": 120, "part": "quarter"},
    "mesh": {"size": [3, 3]},
    "tools": [PUNCH | {"centre_mm": [0, 0, -30.1]}, HOLDER],
}


def test_each_row_is_the_run_of_its_case():
    swept = sweep_case(FRAME, {STIFFNESS: (0.2, 0.5), ANGLE: (20, 30)})
    pairs = [(row[STIFFNESS], row[ANGLE]) for row in swept.rows]
    assert pairs == [(0.2, 20), (0.2, 30), (0.5, 20), (0.5, 30)]
    for row in swept.rows:
        tables = with_value(FRAME, STIFFNESS, row[STIFFNESS])
        case = case_from_tables(with_value(tables, ANGLE, row[ANGLE]))
        summary = case.summary(case.run())
        assert row[LOAD] == pytest.approx(summary["load_N"], rel=1e-9)
        share = summary["wrinkle_risk_share_of_area"]
        assert row["Wrinkle risk (%)"] == pytest.approx(100 * share)
        assert (row[REACHED], row[REASON]) == (1.0, "")
    assert swept.compared == [LOAD, "Largest shear angle (°)", "Wrinkle risk (%)"]


def test_a_process_is_compared_before_its_punch_returns():
    up, down = (
        {"name": name, "steps": 1, "tools": {"punch": {"motion_mm": [0, 0, z]}}}
        for name, z in (("up", 20.0), ("down", 0.0))
    )
    few = {"scene": {"name": "hemisphere_forming"}, "mesh": {"size": (2, 2)}}
    vary = {"shear.stiffness_N_per_mm": (0.05, 0.1)}
    once, returned = (
        sweep_case(few | {"phases": phases}, vary) for phases in ([up], [up, down])
    )
    for row, other in zip(once.rows, returned.rows, strict=True):
        assert other[REACHED] == 1.0
        for name in once.compared:
            assert other[name] == pytest.approx(row[name], rel=1e-7)
        assert row["Punch force (N)"] > 0.1


def test_the_values_of_a_case_file_are_varied(tmp_path):
    """Its keys may be dotted, or in quotation marks."""
    file = tmp_path / "case.toml"
    file.write_text(
        'scene.name = "picture_frame"\nmesh.size = [2, 2]\nstepping.steps = 1\n'
        "[vary]\nscene.shear_angle_deg = [10, 20]\n"
        '"mesh.size" = [[2, 2], [1, 1]]\n'
    )
    swept = sweep_case(file)
    assert swept.vary == {ANGLE: (10, 20), "mesh.size": ([2, 2], [1, 1])}
    assert len(swept.rows) == 4
    swept.write(tmp_path / "sweep.csv")
    rows = list(csv.DictReader((tmp_path / "sweep.csv").read_text().splitlines()))
    assert [row["mesh.size"] for row in rows[:2]] == ["[2, 2]", "[1, 1]"]
    assert float(rows[3][LOAD]) == pytest.approx(swept.rows[3][LOAD])


def test_a_run_of_a_case_with_values_says_that_it_ignores_them(caplog):
    case_from_tables({**FRAME, "vary": {STIFFNESS: [0.2, 0.5]}})
    assert "the table [vary] is for sweeps" in caplog.text


def test_tools_are_selected_by_name_or_number():
    named = with_value(FORMING, "tools.holder.force_N", 5.0)
    assert named["tools"][1]["force_N"] == 5.0
    assert named == with_value(FORMING, "tools.2.force_N", 5.0)
    every = with_value(FORMING, "tools.*.friction", 0.1)
    assert [tool["friction"] for tool in every["tools"]] == [0.1, 0.1]
    assert HOLDER["force_N"] == 2.0
    one, two = variants({**FORMING, "vary": {"tools.holder.force_N": [3, 4]}})
    assert (one.case.scene.tools[1].force, two.case.scene.tools[1].force) == (3, 4)
    assert one.label == "tools.holder.force_N=3"


def test_a_key_of_tools_of_a_scene_is_named():
    scene = {"scene": {"name": "hemisphere_forming"}}
    text = "in [[tools]], which is empty: write scene.friction for the tools of the"
    for name, no in (("*", "table"), ("punch", "table 'punch'")):
        message = re.escape(f"there is no {no} {text}")
        path = f"tools.{name}.friction"
        refused(lambda path=path: with_value(scene, path, 0.1), message)


def test_names_of_tools_and_phases_may_contain_dots():
    """The longest name that the path begins with is selected."""
    own = {"friction": 0.1}
    names = "a", "a.b c", "a.b"
    phases = [{"name": x, "steps": 1, "tools": {"x": {}, "x.y": own}} for x in names]
    tables = with_value({"phases": phases}, "phases.a.b c.steps", 4)
    assert [phase["steps"] for phase in tables["phases"]] == [1, 4, 1]
    tables = with_value(tables, "phases.a.b.tools.x.y.friction", 0.2)
    changed = [phase["tools"]["x.y"]["friction"] for phase in tables["phases"]]
    assert changed == [0.1, 0.1, 0.2]
    assert _value_at(tables, "phases.a.b.name", "") == "a.b"


def test_a_number_in_two_forms_is_one_value():
    with pytest.raises(ValueError, match="at least two different values"):
        varied({"scene": {"friction": [1, 1.0]}})
    assert varied({"scene": {"x": [1, True]}}) == {"scene.x": (1, True)}


REFUSED = {
    "scene.shear_angel_deg": ([1, 2], "scene has no key 'shear_angel_deg'; did you"),
    "scenes.shear_angle_deg": ([1, 2], "there is no table 'scenes'; did you mean"),
    "tools.holder.force_N": ([1, 2], "no table 'holder' in [[tools]], which is empty"),
    "scene.name.x": ([1, 2], "name is a value, not a table"),
    ANGLE: ([10, "x"], f"{ANGLE}=x: {ANGLE} must be a number, got text"),
    "shear.law": (["linear", "none"], "shear.law=none: shear.law is 'none': expected"),
    STIFFNESS: ([0.5, -1.0], f"{STIFFNESS}=-1.0: shear "),
    "fabric.samples": ([2, 3], "fabric.samples"),
    "stepping.tolerance": ([0.1, 0.2], "stepping.tolerance does not apply to a sweep"),
    "mesh.size": (
        [[2, 2]],
        "vary.mesh.size must be an array of at least two different",
    ),
    "mesh.seed": ([1, 1], "vary.mesh.seed must be an array of at least two different"),
    "stepping.steps": (3, "vary.stepping.steps must be an array of at least two"),
}


@pytest.mark.parametrize("key", REFUSED)
def test_a_key_or_value_that_does_not_fit_is_refused_before_any_run(key, monkeypatch):
    monkeypatch.setattr(Case, "run", None)
    values, message = REFUSED[key]
    refused(lambda: sweep_case(FRAME, {key: values}), re.escape(message))


def test_files_of_single_runs_are_left_out_with_a_warning(caplog):
    vary = {STIFFNESS: [0.2, 0.5]}
    variants({**FRAME, "output": {"pictures": False}, "vary": vary})
    assert not caplog.text
    variants({**FRAME, "output": {"test_curve": __file__}, "vary": vary})
    assert caplog.text.count("a sweep leaves out the files of [output]") == 1


def test_a_sweep_varies_something():
    refused(lambda: sweep_case(FRAME), "nothing varies")
    with pytest.raises(CaseFileError):
        sweep_case(FRAME)


def test_a_force_on_a_quarter_is_not_compared_with_one_on_the_whole_ply():
    vary = {"scene.part": ["quarter", "whole"]}
    message = refused(lambda: variants({**FORMING, "vary": vary}), "set scene.part")
    assert "scene.part=quarter and scene.part=whole" in message
    free = [FORMING["tools"][0]]
    assert len(variants({**FORMING, "tools": free, "vary": vary})) == 2
    vary = {"scene.fibres_deg": [0, 15]}
    by_angle = {"scene": {"name": "hemisphere_forming"}, "mesh": FORMING["mesh"]}
    refused(lambda: variants({**by_angle, "vary": vary}), "scene.fibres_deg=0 and")


def test_runs_that_stop_or_are_refused_stay_in_the_table(monkeypatch):
    """The law of shear ends at 20 degrees: a run to 30 stops there."""
    law = {"law": "locking", "stiffness_N_per_mm": 0.1, "locking_angle_deg": 20.0}
    tables = {**FRAME, "shear": law, "stepping": {"steps": 3, "solver": "superlu"}}
    run = Case.run

    def refuses(case):
        if case.scene.shear_angle(case.scene.mesh.p, 1.0).max() < 0.1:
            raise ValueError("the tools cross\nin two lines")
        return run(case)

    monkeypatch.setattr(Case, "run", refuses)
    logging.disable(logging.WARNING)
    none, whole, stopped = sweep_case(tables, {ANGLE: (5, 10, 30)}).rows
    logging.disable(logging.NOTSET)
    assert (none[REASON], none[REACHED], none.get(LOAD)) == ("the tools cross", 0, None)
    assert (whole[REASON], whole[REACHED]) == ("", 1.0)
    assert 0 < stopped[REACHED] < 1
    assert stopped["Displacement (machine) (mm)"] > 0
    assert "load factor" in stopped[REASON]


def test_values_that_change_no_figure_are_a_warning(caplog):
    """Of two keys, one changes figures."""
    vary = {"shear.wrinkling_angle_deg": (80, 85), STIFFNESS: (0.1, 0.2)}
    sweep_case(FRAME, vary)
    assert "the values of shear.wrinkling_angle_deg change no figure" in caplog.text
    assert STIFFNESS not in caplog.text


def test_a_run_without_a_converged_step_has_no_figures(monkeypatch):
    result = case_from_tables(FRAME).run()
    at_rest = replace(result, states=result.states[:1])

    def stops(case):
        raise StepError("no first step", at_rest, np.zeros(0, dtype=int))

    monkeypatch.setattr(Case, "run", stops)
    row, _ = sweep_case(FRAME, {ANGLE: (20, 30)}).rows
    ends = {"linear solves", "load factor", "reason", "warnings"}
    assert row.keys() == {ANGLE} | ends
    assert row[REASON] == "no first step"


def test_finished_runs_are_not_repeated_unless_their_case_changes(
    tmp_path, monkeypatch
):
    out, called, run = tmp_path / "sweep.jsonl", [], Case.run
    monkeypatch.setattr(Case, "run", lambda case: called.append(1) or run(case))
    first = sweep_case(FRAME, {STIFFNESS: (0.2, 0.4)}, out=out)
    again = sweep_case(FRAME, {STIFFNESS: (0.4, 0.2, 0.8)}, out=out)
    assert len(called) == 3
    assert again.rows[1] == first.rows[0]
    changed = {**FRAME, "scene": {"name": "picture_frame", "shear_angle_deg": 20}}
    sweep_case(changed, {STIFFNESS: (0.2, 0.4)}, out=out)
    assert len(called) == 5


def test_a_run_that_fails_is_named_and_run_again(tmp_path, monkeypatch):
    def broken(case):
        raise MemoryError

    monkeypatch.setattr(Case, "run", broken)
    found = variants({**FRAME, "vary": {STIFFNESS: [0.2, 0.4]}})
    swept = run_variants(found, out=tmp_path / "sweep.jsonl")
    assert [row[REASON] for row in swept.rows] == ["MemoryError"] * 2
    assert f"{STIFFNESS}=0.2: MemoryError" in swept.incomplete
    monkeypatch.undo()
    again = run_variants(found, out=tmp_path / "sweep.jsonl")
    assert not again.incomplete


def test_the_written_case_repeats_the_sweep_in_another_folder(tmp_path):
    """File names in [vary] are whole."""
    header = "shear angle (deg),moment (N mm/mm2)"
    for name, slope in (("soft", 0.1), ("stiff", 0.4)):
        rows = "".join(f"{x},{slope * x / 60}\n" for x in (0, 30, 60))
        (tmp_path / f"{name}.csv").write_text(f"{header}\n{rows}")
    tables = {**FRAME, "vary": {"shear.law": ["soft.csv", "stiff.csv"]}}
    found = variants(tables, tmp_path)
    file = tmp_path / "other" / "case.toml"
    file.parent.mkdir()
    file.write_text(case_text(resolved_case(found), "# A sweep."), encoding="utf-8")
    again = variants(read_tables(file), file.parent)
    laws = [one.case.fabric.shear_law.value(0.5) for one in found]
    assert [one.case.fabric.shear_law.value(0.5) for one in again] == laws
    assert laws[1] > laws[0]


def test_values_of_any_kind_are_written_to_a_case():
    vary = {"a.b": [{"law": "x", "c": [1, 2.5]}, "text"], "a.c": [True, False]}
    text = case_text(declared({**FRAME, "vary": vary}), "# A sweep.")
    assert '"a.b" = [{law = "x", c = [1, 2.5]}, "text"]' in text
    assert '"a.c" = [true, false]' in text


def test_tables_and_rows_are_shown_by_their_last_value():
    """With a number if several are equal."""
    key = "phases.up.tools.holder.force_N"
    ends = (5, 5), (2, 7), (3, 7)
    tables = [{"travel_of": "punch", "rows": [[0, x], [9, y]]} for x, y in ends]
    law = {"law": "locking", "stiffness_N_per_mm": 0.1}
    vary = {key: (*tables, 5.0, [0, 1], [[0.25, 2], [1, 6.5]], law)}
    rows = [{key: value, "reason": "late"} for value in vary[key]]
    swept = CaseSweep(vary, rows)
    over = "over punch"
    shown = [f"to 5 {over}", f"to 7 {over} (1)", f"to 7 {over} (2)", 5.0, [0, 1]]
    shown += ["to 6.5", "locking"]
    values, _, _ = swept.drawn
    assert values == {"Holder force in phase up (N)": shown}
    assert legible(swept.in_words, [key])[0] == [f"to 5 {over}"]
    assert swept.incomplete[1] == f"{key}=to 7 {over} (1): late"


def test_keys_in_quotation_marks_are_the_same_keys():
    """As in TOML."""
    quoted = """phases."close".tools.'*'.friction"""
    key = "phases.close.tools.*.friction"
    assert words.setting(f"{quoted}=0.1") == (key, 0.1)
    assert words.variation(f"{quoted}=0.1,0.2") == (key, [0.1, 0.2])
    assert varied({quoted: [0.1, 0.2]}) == {key: (0.1, 0.2)}
    assert words.setting("""tools.a"b.side="1" """)[0] == 'tools.a"b.side'


@pytest.mark.parametrize(
    ("key", "label"),
    [
        ("tools.holder.force_N", "Holder force (N)"),
        ("scene.holder_pressure_N_per_mm2", "Holder pressure (N/mm²)"),
        ("bending.warp_N_mm", "Bending warp (N·mm)"),
        ("fabric.file", "Fabric file"),
        ("tools.*.friction", "Friction"),
        ("phases.up.tools.punch.friction", "Punch friction in phase up"),
        ("phases.up.steps", "Steps in phase up"),
        ("phases.up.tools.holder.force_N", "Holder force in phase up (N)"),
    ],
)
def test_an_axis_has_the_unit_of_its_key(key, label):
    assert axis_of(key) == label
