import argparse
import csv
import json

import numpy as np
import pytest
from helpers import drawn_here

from skfem_textile import (
    AdaptiveStepper,
    Fabric,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
)
from studies.__main__ import main
from studies.common.rivals.newton import STEPS, NotConvergedError, Run
from studies.common.rivals.plain import Plain
from studies.common.rivals.rival import QUAD4, TRIANGLE6
from studies.common.rivals.with_native import Native
from studies.error_time import study, tables, timed_codes
from studies.error_time.errors import errors, unfolded
from studies.error_time.study import CODES, PROBLEMS, STUDY
from studies.error_time.timed_codes import OtherCode, Refined, ThisLibrary
from studies.formulations.cases import AUTO, BIAS, Case


def row(code, element, across, seconds, angle=1.0, load=5.0, **more):
    known = {"position": 0.01, "strain": 1e-3, "steps": 1, "linear_solves": 5}
    times = {"seconds": seconds, "seconds_min": seconds, "seconds_max": seconds}
    return {
        **{"scene": "strip", "code": code, "element": element, "across": across},
        **{"unknowns": 10 * across, "angle": angle, "load_error": load, "note": ""},
        **(known | times | more),
    }


ROWS = [
    row("skfem_textile", "P2", 4, 1.0, angle=0.5),
    row("skfem_textile", "P2", 8, 2.0, angle=0.05, load=0.5),
    row("skfem_textile", "P2", 16, 6.0, angle=0.02, load=0.1),
    row("skfem_textile", "Q4", 8, 1.0, angle=0.09, load=0.5),
    row("skfem_textile", "Q4", 16, 3.0, angle=0.2, load=0.5),
    row("other", "P2", 4, 1.5, angle=0.5),
    row("other", "P2", 8, 8.0, angle=0.05, load=0.5),
    row("other", "P2", 16, np.nan, angle=np.nan, note="too hard"),
    {"scene": "strip", "code": "third", "element": "P2", "across": 0, "note": "no"},
]


def test_the_bar_is_reached_by_the_fastest_run_that_stays_within_it():
    """Q4 is within the bar at 8 across by chance: at 16 it is not."""
    summary = tables.summary(ROWS)
    assert summary["fastest"] == "skfem_textile, P2"
    of = summary["methods"]
    assert of["skfem_textile, P2"] == {"across": 8, "seconds": 2.0, "over_fastest": 1.0}
    assert of["other, P2"]["over_fastest"] == 4.0
    assert of["skfem_textile, Q4"] is None
    assert summary["skipped"] == {"third, P2": "no"}
    assert summary["refused"] == ["other, P2, 16 across: too hard"]


def test_a_rival_that_wins_is_named():
    faster = row("other", "P2", 8, 0.5, angle=0.05, load=0.5)
    summary = tables.summary([*ROWS[:3], faster])
    assert summary["fastest"] == "other, P2"
    assert summary["methods"]["skfem_textile, P2"]["over_fastest"] == 4.0
    table = tables.to_the_bar([*ROWS[:3], faster])
    assert table.splitlines()[2].startswith("| other, P2 | 8 | 80 |")
    assert "| 0.25 |" in table.splitlines()[2]  # over the fastest of ours


def test_the_bar_may_be_reached_by_none():
    assert tables.summary(ROWS[:1])["fastest"] is None
    assert "| - | - |" in tables.to_the_bar(ROWS[:1])
    assert tables.same_mesh(ROWS[:1]) == ""


def test_the_bar_of_the_bias_extension_is_on_the_load_alone():
    rows = [r | {"scene": "bias_extension", "load_error": 0.029} for r in ROWS[:2]]
    summary = tables.summary(rows)
    assert summary["methods"]["skfem_textile, P2"]["across"] == 4


def test_codes_with_the_same_element_are_compared_on_the_finest_mesh_of_both():
    last = tables.same_mesh(ROWS).splitlines()[2:]
    assert len(last) == 1
    assert last[0].startswith("| P2 | other | 8 |")
    assert last[0].endswith("| 4 |")


def test_skipped_and_refused_are_told_under_the_tables():
    told = tables.tables(ROWS).splitlines()[-2:]
    assert told == ["- third, P2: no", "- other, P2, 16 across: too hard"]


def test_the_figure_has_a_panel_for_every_error(tmp_path):
    curves = tables.curves(ROWS)
    assert len(curves) == 4
    assert curves["Position error (mm)"]["other", "P2"][0] == [1.5, 8.0]
    figures = pytest.importorskip("studies.error_time.figure")
    figure = figures.work_precision(curves)
    assert [axes.get_ylabel() for axes in figure.axes] == list(curves)
    for axes, lines in zip(figure.axes, curves.values(), strict=True):
        for drawn, (seconds, error) in zip(
            axes.lines[1::2], lines.values(), strict=True
        ):
            np.testing.assert_array_equal(drawn.get_xydata().T, [seconds, error])
    STUDY.draw(ROWS, tmp_path)
    assert (tmp_path / "error_time.png").read_bytes()[1:4] == b"PNG"


def test_every_formulation_and_every_required_rival_takes_part():
    own = [c for c in CODES if isinstance(c, ThisLibrary)]
    made = {type(c.method.formulation(1.0)) for c in own}
    assert made >= {OnePoint, Macro, Quadratic}
    others = {(c.code, c.element) for c in CODES if isinstance(c, OtherCode)}
    for code in ("scikit-fem", "FElupe", "DOLFINx", "scikit-fem-native"):
        assert {(code, "Q4, 2×2"), (code, "P2, 3 points")} <= others
    assert ("scikit-fem", "Q9, 3×3") in others
    assert ("FElupe with Pardiso", "P2, 3 points") in others
    assert "Q4, isotropic" in {c.element for c in own}


def test_the_bias_extension_is_pulled_to_40_degrees_at_a_ratio_of_200000():
    problem = PROBLEMS["bias_extension"]
    assert problem.E / problem.law.stiffness == 2e5
    scene = Case("", problem, AUTO, 4, 1).scene()
    middle = scene.mesh.p.mean(axis=1, keepdims=True)
    assert np.degrees(scene.shear_angle(middle, 1.0)) == pytest.approx(40)
    assert BIAS[1].last == 4  # the other study's own


def test_errors_are_those_of_the_scene():
    problem = PROBLEMS["bias_extension"]
    for method in (AUTO, *(c.method for c in CODES[1:5])):
        scene = Case("", problem, method, 4, 1).scene()
        ply = Ply(scene.mesh, problem.fabric(scene), method.formulation(4.0))
        result = LoadStepper(ply, scene.conditions, 2).run()
        known = scene.summary(result)
        found = errors(scene, ply.basis, result.u, known["load_over_exact"])
        assert found["position"] == pytest.approx(known["displacement_error_rms"])
        assert found["angle"] == pytest.approx(known["shear_angle_error_rms_deg"])
        strain = np.abs(ply.fibre_strain(result.u)).max()
        assert found["strain"] == pytest.approx(strain)
        assert found["load_error"] == abs(known["load_over_exact"] - 1)
        assert unfolded(ply.basis, result.u)
        assert not unfolded(ply.basis, -2 * ply.basis.doflocs[0])


def test_the_strain_of_this_library_is_the_one_that_the_law_sees():
    problem, macro = PROBLEMS["strip"], CODES[1]
    row = macro.measured(problem, 4)
    scene = Case("", problem, macro.method, 4, timed_codes._SEED).scene()
    ply = Ply(scene.mesh, problem.fabric(scene), macro.method.formulation(1.0))
    u = LoadStepper(ply, scene.conditions, 1).run().u
    assert row["strain"] == pytest.approx(np.abs(ply.law_strain(u)).max())
    assert row["strain"] < 0.9 * np.abs(ply.fibre_strain(u)).max()


def test_a_mesh_is_refined_to_tolerances_where_there_is_a_load():
    (refined,) = (code for code in CODES if isinstance(code, Refined))
    taken = {
        scene: [case.code for case in STUDY.cases(argparse.Namespace(scene=scene))]
        for scene in PROBLEMS
    }
    assert refined not in taken["strip"]
    assert len(taken["strip"]) == len(CODES) - 1
    assert taken["bias_extension"] == list(CODES)
    assert refined.refinements == tuple(sorted(refined.refinements, reverse=True))


def test_a_run_to_a_tolerance_counts_whole_and_says_what_it_is_refined_to(monkeypatch):
    results = []

    class Kept(AdaptiveStepper):
        def run(self, resume=False):
            results.append(super().run(resume))
            return results[-1]

    monkeypatch.setattr(timed_codes, "AdaptiveStepper", Kept)
    refined = next(code for code in CODES if isinstance(code, Refined))
    problem = PROBLEMS["bias_extension"]
    found = refined.measured(problem, 0.1)
    assert len(results) == 1 + found["repeats"]  # the first is not timed
    last = results[-1]
    assert last.tolerance_met
    assert len(last.rounds) > 1
    assert found["linear_solves"] == sum(one.linear_solves for one in last.rounds)
    assert found["unknowns"] == last.rounds[-1].unknowns
    uniform = study.MACRO_TRIANGLES
    first = Ply(Case("", problem, uniform, 8, 1).scene().mesh, Fabric(1e5), Macro())
    assert last.rounds[0].unknowns == first.basis.N
    row = {"scene": "bias_extension", "code": "skfem_textile", "element": "refined"}
    row |= found | {"load_error": 0.01}  # as a run that reaches the bar
    assert "| **refined** | 8, refined to 0.1 |" in tables.to_the_bar([row])
    assert "8 across, refined to 0.1: " in STUDY.line([row])
    assert (
        tables.summary([row])["methods"]["skfem_textile, refined"]["tolerance"] == 0.1
    )


def test_a_rival_takes_the_fewest_steps_to_an_unfolded_state(monkeypatch):
    class Slow(Plain):
        def run(self, task, steps, repeats):
            tried.append((steps, repeats))
            if steps < STEPS[2]:
                raise NotConvergedError
            if steps == STEPS[2]:
                folded = -2 * task.basis.doflocs[0]
                return Run(folded, folded, 1, [0.1])
            return super().run(task, steps, repeats)

    monkeypatch.setattr(timed_codes, "_SOME_SECONDS", np.inf)
    tried = []
    found = OtherCode(Slow(QUAD4)).measured(PROBLEMS["strip"], 4)
    assert found["steps"] == STEPS[3]
    assert [steps for steps, _ in tried] == [*STEPS[:4], STEPS[3]]
    assert found["repeats"] == timed_codes._REPEATS
    assert found["seconds_min"] <= found["seconds"] <= found["seconds_max"]


def test_a_rival_that_never_converges_says_so():
    class Never(Plain):
        def run(self, task, steps, repeats):
            raise NotConvergedError

    found = OtherCode(Never(TRIANGLE6)).measured(PROBLEMS["strip"], 4)
    assert found["note"] == "no unfolded state in up to 80 equal steps"
    assert np.isnan(found["seconds"])
    assert found["unknowns"] > 0


def test_a_run_of_this_library_that_stops_early_says_so(monkeypatch):
    class Once(LoadStepper):
        def __init__(self, ply, conditions, steps):
            super().__init__(ply, conditions, steps, strategies=["newton"])
            self.max_halvings = 0

    monkeypatch.setattr(timed_codes, "LoadStepper", Once)
    found = CODES[5].measured(PROBLEMS["strip"], 16)
    assert found["note"].startswith("stopped at load factor 0")
    assert np.isnan(found["angle"])


def test_long_runs_are_repeated_less_often():
    assert timed_codes._repeats(0.1) == 5
    assert timed_codes._repeats(2.0) == 3
    assert timed_codes._repeats(30.0) == 1


def test_a_method_is_refined_until_a_run_takes_long(monkeypatch):
    class Steady:
        code, element, refinements = "code", "Q4", (4, 6, 8, 12, 16)

        def missing(self):
            return ""

        def measured(self, problem, across):
            return {"seconds": float(across), "note": "", "across": across}

    monkeypatch.setattr(study, "LONG", 10.0)
    rows = STUDY.examine(study.Case("strip", Steady()))
    assert [one["across"] for one in rows] == [4, 6, 8, 12]


def test_the_study_writes_its_report(tmp_path, monkeypatch, capsys):
    class Missing(Native):
        packages = {"no_such_module": "scikit-fem-native"}  # noqa: RUF012

    some = (CODES[0], CODES[3], OtherCode(Plain(TRIANGLE6)))
    missing = OtherCode(Missing(QUAD4))
    monkeypatch.setattr(study, "CODES", (*some, missing))
    for kind in (ThisLibrary, OtherCode):
        monkeypatch.setattr(kind, "refinements", (4, 6))
    out = tmp_path / "out"
    assert main(["error_time", "--scene", "strip", "--out", str(out)]) == 0
    names = {path.name for path in out.iterdir()}
    assert names == {*STUDY.files, *drawn_here(STUDY)}
    summary = json.loads((out / "summary.json").read_text())
    why = "skipped, not installed: scikit-fem-native"
    assert summary["skipped"] == {"scikit-fem-native, Q4, 2×2": why}
    assert summary["machine"]["packages"]["numpy"] == np.__version__
    with open(out / "error_time.csv") as file:
        rows = list(csv.DictReader(file))
    assert [one["across"] for one in rows] == ["4", "6"] * 3 + ["0"]
    same = [one for one in rows if one["element"] == "P2, 3 points"]
    assert float(same[0]["position"]) == pytest.approx(float(same[2]["position"]))
    assert (out / "error_time.md").read_text().startswith("Machine: ")
    said = capsys.readouterr().out
    assert "strip, scikit-fem, P2, 3 points, 6 across: " in said
    assert f"strip, scikit-fem-native, Q4, 2×2: {why}" in said


def test_the_scenes_of_the_command_line_are_those_of_the_study(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["error_time", "--scene", "trellis", "--out", str(tmp_path)])
    said = capsys.readouterr().err
    assert all(scene in said for scene in PROBLEMS)
