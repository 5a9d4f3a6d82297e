import argparse
from pathlib import Path

import numpy as np
import pytest

from skfem_textile import (
    LoadStepper,
    Ply,
)
from studies.common.rivals.codes import Plain
from studies.common.rivals.newton import STEPS, NotConvergedError, Run
from studies.common.rivals.rival import QUAD4, TRIANGLE6
from studies.error_time import cases, fronts, study
from studies.error_time.cases import (
    CODES,
    PROBLEMS,
    OtherCode,
    Timed,
    shape_errors,
    unfolded,
)
from studies.error_time.fronts import SETS
from studies.error_time.study import STUDY
from studies.formulations.cases import SEEDS, Case

NO_OPTIONS = argparse.Namespace()


def test_the_codes_take_turns_on_each_seed():
    timed = [case for case in STUDY.cases(NO_OPTIONS) if isinstance(case, Timed)]
    seeds = [case.seed for case in timed]
    assert seeds == sorted(seeds)
    assert set(seeds) == set(SEEDS)
    names = [str(case) for case in timed]
    assert len(set(names)) == len(names)


def runs(across, seconds, *errors):
    """Rows of one code and element, one for each seed; None if it failed."""
    head = {"scene": "strip", "code": "FElupe", "element": "P2", "solver": "fastest"}
    head |= {"across": across, "unknowns": across, "steps": 1, "linear_solves": 5}
    return [
        head
        | {"angle": error, "seconds": None if error is None else seconds}
        | {"seed": seed, "note": "too hard" if error is None else ""}
        for seed, error in zip(SEEDS, errors, strict=True)
    ]


def front(*rows):
    return fronts.fronts(rows, fronts.CRITERIA["angle"], "fastest")["FElupe"]


def test_a_mesh_on_which_most_seeds_fail_refutes_coarser_ones():
    coarse, failed = runs(4, 1.5, *5 * [0.5]), runs(8, 8.0, *5 * [None])
    assert fronts.fastest(front(*coarse), 1.0).across == 4
    assert fronts.fastest(front(*coarse, *failed), 1.0) is None


def test_failed_seeds_have_an_infinite_error_in_the_median():
    (point,) = front(*runs(4, 1.0, None, None, 0.1, 0.2, 0.3))
    assert (point.seeds, point.within) == (3, 0.3)


def test_a_front_has_ever_smaller_errors_for_ever_longer_times():
    meshes = (
        runs(4, 1.0, *5 * [0.5]),
        runs(8, 2.0, *5 * [0.6]),
        runs(16, 3.0, *5 * [0.1]),
    )
    points = front(*(row for rows in meshes for row in rows))
    assert [(x.across, x.within) for x in points] == [(4, 0.6), (16, 0.1)]


def test_fronts_are_drawn_at_the_median_times_and_errors():
    pytest.importorskip("matplotlib")
    rows = STUDY.stored(Path(__file__).parents[2] / "docs" / "error-time")
    angle, _ = study.draw_fronts(rows).axes
    known = fronts.fronts(rows, fronts.CRITERIA["angle"], "fastest")
    shown = [
        [x for x in of if x.within <= study._MOST["angle"]] for of in known.values()
    ]
    lines = [line.get_xydata() for line in angle.lines if line.get_zorder() == 3]
    for drawn, points in zip(lines, filter(None, shown), strict=True):
        np.testing.assert_allclose(drawn, [(x.seconds[0], x.within) for x in points])


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
