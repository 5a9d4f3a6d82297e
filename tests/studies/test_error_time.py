import argparse

import numpy as np
import pytest

from skfem_textile import (
    LoadStepper,
    Ply,
)
from studies.common.rivals.codes import Native, Plain
from studies.common.rivals.newton import STEPS, NotConvergedError, Run
from studies.common.rivals.rival import QUAD4, TRIANGLE6
from studies.common.tables import csv_table, rows_of_csv
from studies.error_time import cases, fronts, study
from studies.error_time.cases import (
    CELLS,
    CODES,
    PROBLEMS,
    OtherCode,
    ThisLibrary,
    Timed,
    shape_errors,
    unfolded,
)
from studies.error_time.fronts import CRITERIA, SETS
from studies.error_time.study import STUDY
from studies.formulations.cases import SEEDS, Case

OURS = ThisLibrary.code
NO_OPTIONS = argparse.Namespace()
LOADS = {"Quadratic()": (44.0, 42.0, 41.0, 40.5), "Full()": (47.0, 43.0, 41.0, 40.0)}


def of_reference():
    head = {"scene": "bias_extension", "code": cases.CODE, "inextensible": 50.0}
    return [
        head | {"element": element, "across": cells, "load": load}
        for element, loads in LOADS.items()
        for cells, load in zip(CELLS, loads, strict=True)
    ]


def runs(code, element, across, seconds, errors, solver="fastest", **more):
    """A row for each seed."""
    return [
        {
            **{"scene": "strip", "code": code, "element": element, "solver": solver},
            **{"seed": seed, "across": across, "unknowns": 10 * across},
            **{"steps": 1, "linear_solves": 5, "angle": error},
            **{"load": 1.0 if error is not None else None},
            **{"seconds": seconds if error is not None else None},
            **{"note": "" if error is not None else "too hard"},
            **more,
        }
        for seed, error in zip(SEEDS, errors, strict=True)
    ]


def same(error):
    return [error] * len(SEEDS)


ROWS = [
    *runs(OURS, "P2", 4, 1.0, same(0.5)),
    *runs(OURS, "P2", 8, 2.0, [0.01, 0.02, 0.05, 0.06, 0.3]),
    *runs(OURS, "P2", 16, 6.0, same(0.02)),
    *runs(OURS, "Q4", 8, 1.0, same(0.09)),
    *runs(OURS, "Q4", 16, 3.0, same(0.2)),
    *runs("FElupe", "P2", 4, 1.5, same(0.5)),
    *runs("FElupe", "P2", 8, 8.0, same(0.05), linear_solves=10),
    *runs("FElupe", "P2", 16, 9.0, same(None)),
]
THERE = rows_of_csv(csv_table(ROWS))  # as they are stored


def front(rows, solvers="fastest"):
    return fronts.fronts(rows, CRITERIA["angle"], solvers)


def test_the_time_to_an_error_uses_a_mesh_confirmed_by_finer_ones():
    """Q4 is within 0.1° at 8 across by chance: at 16 it is not."""
    ours = front(THERE)[OURS]
    assert (ours[0].element, ours[0].across, ours[0].within) == ("Q4", 8, 0.2)
    best = fronts.fastest(ours, 0.1)
    assert (best.element, best.across) == ("P2", 8)
    assert fronts.fastest(ours, 0.001) is None


def test_errors_and_times_are_medians_with_ranges_over_the_seeds():
    rows = runs(OURS, "P2", 8, 1.0, [0.01, 0.02, 0.05, 0.06, 0.3])
    for row, seconds in zip(rows, (1.0, 2.0, 3.0, 4.0, 9.0), strict=True):
        row["seconds"] = seconds
    (point,) = front(rows)[OURS]
    assert point.error == (0.05, 0.01, 0.3)
    assert point.seconds == (3.0, 1.0, 9.0)
    assert point.seeds == 5


def test_a_front_has_ever_smaller_errors_for_ever_longer_times():
    for points in front(THERE).values():
        times = [point.seconds.median for point in points]
        errors = [point.within for point in points]
        assert times == sorted(times)
        assert errors == sorted(errors, reverse=True)
        assert len(set(errors)) == len(errors)


def test_a_mesh_with_mostly_failing_seeds_refutes_coarser_ones():
    assert "FElupe" in front(THERE)
    assert fronts.fastest(front(THERE)["FElupe"], 1.0) is None
    few = runs("FElupe", "P2", 4, 1.0, [None, 0.1, 0.1, 0.1, 0.1])
    (point,) = front(few)["FElupe"]
    assert (point.seeds, point.within) == (4, 0.1)


def test_an_abandoned_search_ends_the_refinement_and_refutes_nothing():
    note = f"inverted elements in up to 5 equal steps, {cases.GIVEN_UP} after 9 s"
    rows = [*ROWS[:-5], *runs("FElupe", "P2", 16, 9.0, same(None), note=note)]
    assert fronts.fastest(front(rows)["FElupe"], 0.1).across == 8


def test_the_ratio_of_times_is_the_product_of_solves_and_time_per_solve():
    note = f"{cases.GIVEN_UP}"
    rows = [*ROWS[:-5], *runs("FElupe", "P2", 16, 9.0, same(None), note=note)]
    pair = fronts.compared(front(rows), 0.1)
    assert (pair.own.element, pair.other.code) == ("P2", "FElupe")
    assert (pair.ratio, pair.solves, pair.per_solve) == (4.0, 2.0, 2.0)
    curve = dict(fronts.ratios(front(rows)))
    assert curve[0.5] == 1.5  # ours on Q4 at 8 across
    assert curve[0.05] == 4.0
    assert 0.02 not in curve  # which no other code reaches


def test_another_code_that_is_faster_is_named_with_a_ratio_below_one():
    faster = runs("DOLFINx", "P2", 8, 0.5, same(0.05), solver="MUMPS")
    pair = fronts.compared(front([*ROWS[:-5], *faster]), 0.1)
    assert pair.other.code == "DOLFINx"
    assert pair.ratio == 0.25
    for solvers in SETS:  # it has only one solver
        assert "DOLFINx" in front(faster, solvers)
    table = study.ratios([*ROWS[:-5], *faster])
    assert "DOLFINx, P2, 8 across" in table
    assert "| 0.25 | 1 | 0.25 |" in table
    required = [row | {"solver": "required"} for row in ROWS[:-5]]
    words = study.in_words([*required, *faster])
    assert words["angle_0.1_ratio"] == "0.25"
    assert words["angle_0.1_other_code"] == "DOLFINx"
    assert words["angle_0.02_ratio"] == "not reached"
    assert "angle_0.02_other_code" not in words
    assert words["load_3_ratio"] == "-"


def test_sets_of_solvers_are_not_mixed():
    required = runs("FElupe", "P2", 8, 0.1, same(0.05), solver="required")
    assert "FElupe" not in front(required)
    assert front(required, "required")["FElupe"][0].seconds.median == 0.1


def test_the_load_of_the_bias_extension_is_compared_with_the_converged_one():
    """The load of inextensible fibres is not used."""
    rows = [*of_reference(), *runs(OURS, "P2", 8, 1.0, same(1.0), load=41.0)]
    for row in rows[-5:]:
        row["scene"] = "bias_extension"
    end = cases.converged(rows)
    # 40.5 − 0.5, and Full's 40 − 1, extrapolated by their ratio of changes, 2.
    assert end.load == pytest.approx((40.0 + 39.0) / 2)
    assert end.uncertainty == 1.0  # of both the difference and the last change
    (series,) = fronts.methods(rows, CRITERIA["load"]).values()
    assert series[0].error.median == pytest.approx(41.0 / 39.5 - 1)
    words = study.in_words(rows)
    assert words["reference"] == "39.50 N"
    assert "| `Full()` | 47.0000 | 43.0000 | 41.0000 | 40.0000 | 39.0000 |" in (
        study.reference(rows)
    )


def test_loads_are_not_judged_without_the_whole_reference():
    rows = [*of_reference()[1:], *runs(OURS, "P2", 8, 1.0, same(1.0), load=41.0)]
    for row in rows[-5:]:
        row["scene"] = "bias_extension"
    assert cases.converged(rows) is None
    assert fronts.methods(rows, CRITERIA["load"])[OURS, "P2", "fastest"] == []
    assert "reference" not in study.in_words(rows)


def test_the_smallest_error_of_an_element_above_the_target_is_given():
    assert "| **skfem_textile** | Q4 | not reached: 0.2° at 16 across |" in (
        study.elements(THERE)
    )
    assert "| **skfem_textile** | P2 | 2 s, 8 across |" in study.elements(THERE)


def test_the_fronts_have_a_line_for_each_code_with_its_name_at_the_end():
    pytest.importorskip("matplotlib")
    loads = runs(OURS, "P2", 8, 1.0, same(1.0), load=39.6)
    for row in loads:
        row["scene"] = "bias_extension"
    rows = [*of_reference(), *ROWS, *loads]
    angle, load = study.draw_fronts(rows).axes
    assert [text.get_text() for text in angle.texts] == ["this library"]
    drawn = angle.lines[0].get_xydata()
    points = front(ROWS)[OURS]
    np.testing.assert_allclose(drawn[:, 0], [p.seconds.median for p in points])
    np.testing.assert_allclose(drawn[:, 1], [p.within for p in points])
    # An error below the uncertainty is at the edge of its band, with an open marker.
    edge = 100 * 1.0 / 39.5
    np.testing.assert_allclose(load.lines[0].get_xydata(), [[1.0, edge]])
    assert load.lines[2].get_markerfacecolor() == "white"
    assert len(load.lines[2].get_xydata()) == 1


def test_the_codes_take_turns_on_each_seed():
    timed = [case for case in STUDY.cases(NO_OPTIONS) if isinstance(case, Timed)]
    seeds = [case.seed for case in timed]
    assert seeds == sorted(seeds)
    assert set(seeds) == set(SEEDS)
    names = [str(case) for case in timed]
    assert len(set(names)) == len(names)


def test_errors_of_the_shape_are_those_of_the_scene():
    problem = PROBLEMS["strip"]
    for code in CODES[:5]:
        scene = Case("", problem, code.method, 4, 1).scene()
        ply = Ply(scene.mesh, problem.fabric(scene), code.method.formulation(4.0))
        result = LoadStepper(ply, scene.conditions, 2).run()
        known = scene.summary(result)
        errors = shape_errors(scene, ply.basis, result.u)
        assert errors["position"] == pytest.approx(known["displacement_error_rms"])
        assert errors["angle"] == pytest.approx(known["shear_angle_error_rms_deg"])
        assert unfolded(ply.basis, result.u)
        assert not unfolded(ply.basis, -2 * ply.basis.doflocs[0])


def test_the_bias_extension_has_a_load_in_newtons_and_no_errors_of_the_shape():
    problem, code = PROBLEMS["bias_extension"], CODES[1]
    row = code.measured(problem, 4, 1)
    scene = Case("", problem, code.method, 4, 1).scene()
    ply = Ply(scene.mesh, problem.fabric(scene), code.method.formulation(1.0))
    result = LoadStepper(ply, scene.conditions, 1).run()
    share = scene.summary(result)["load_over_exact"]
    assert row["load"] == pytest.approx(share * scene.load(problem.law, 1.0))
    assert row["angle"] is None


def test_the_solver_belongs_to_the_set(monkeypatch):
    solvers = []

    class Kept(LoadStepper):
        def __init__(self, *given, solver):
            solvers.append(solver)
            super().__init__(*given, solver=solver)

    monkeypatch.setattr(cases, "LoadStepper", Kept)
    for solver in SETS:
        ours = next(c for c in CODES if c.solver == solver)
        ours.measured(PROBLEMS["strip"], 4, 1)
    assert solvers == ["rslab", "rslab", "auto", "auto"]


def test_a_rival_uses_the_cheaper_of_the_first_two_sufficient_step_counts():
    class Slow(Plain):
        def run(self, task, steps, repeats):
            tried.append((steps, repeats))
            if steps < STEPS[2]:
                raise NotConvergedError
            u = np.zeros(task.nodes.size)
            if steps == STEPS[2]:
                u = -2 * task.basis.doflocs[0]  # folded
            solves = {STEPS[3]: 90, STEPS[4]: 80}.get(steps, 1)
            return Run(u, u, solves, [0.1] * repeats)

    tried = []
    problem = PROBLEMS["strip"]
    row = OtherCode(Slow(QUAD4)).measured(problem, 4, 99)
    assert (row["steps"], row["linear_solves"]) == (STEPS[4], 80)
    searched = [(steps, 0) for steps in STEPS[:5]]
    assert tried == [*searched, (STEPS[4], 1)]
    # Another code with the element uses the number; a finer mesh starts near it.
    tried.clear()
    OtherCode(Slow(QUAD4)).measured(problem, 4, 99)
    assert tried == [(STEPS[4], 1)]
    tried.clear()
    OtherCode(Slow(QUAD4)).measured(problem, 6, 99)
    assert tried[0] == (STEPS[3], 0)


def test_a_rival_that_never_converges_is_marked():
    class Never(Plain):
        def run(self, task, steps, repeats):
            raise NotConvergedError

    row = OtherCode(Never(TRIANGLE6)).measured(PROBLEMS["strip"], 4, 98)
    assert row["note"] == "inverted elements in up to 80 equal steps"
    assert row["seconds"] is None
    assert row["unknowns"] > 0


def test_a_long_search_is_abandoned(monkeypatch):
    class Never(Plain):
        def run(self, task, steps, repeats):
            raise NotConvergedError

    monkeypatch.setattr(cases, "PATIENCE", -1.0)
    row = OtherCode(Never(TRIANGLE6)).measured(PROBLEMS["strip"], 4, 97)
    assert cases.GIVEN_UP in row["note"]


def test_a_run_of_this_library_that_stops_early_is_marked(monkeypatch):
    class Once(LoadStepper):
        def __init__(self, ply, conditions, steps, solver):
            super().__init__(ply, conditions, steps, method="plain")
            self.max_halvings = 0

    monkeypatch.setattr(cases, "LoadStepper", Once)
    row = CODES[5].measured(PROBLEMS["strip"], 16, 1)
    assert row["note"].startswith("stopped at load factor 0")
    assert row["angle"] is None


@pytest.mark.parametrize(("long", "meshes"), [(10.0, [4, 6, 8, 12]), (3.0, [4, 6])])
def test_a_method_is_refined_once_and_until_a_run_takes_long(monkeypatch, long, meshes):
    class Steady:
        code, element, solver = "code", "Q4", "required"

        def missing(self):
            return ""

        def measured(self, problem, across, seed):
            return {"seconds": float(across), "note": "", "across": across}

    monkeypatch.setattr(cases, "LONG", long)
    case = Timed(1, "strip", PROBLEMS["strip"], Steady(), cases.ACROSS)
    assert [one["across"] for one in STUDY.examine(case)] == meshes


def test_a_code_that_is_not_installed_has_one_row():
    class Missing(Native):
        packages = {"no_such_module": "scikit-fem-native"}  # noqa: RUF012

    code = OtherCode(Missing(QUAD4))
    (row,) = Timed(1, "strip", PROBLEMS["strip"], code, cases.ACROSS).rows()
    assert row["note"] == "skipped, not installed: scikit-fem-native"
    assert row["across"] == 0
