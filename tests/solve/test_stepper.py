import logging
import sys
from functools import cache
from itertools import count

import numpy as np
import pytest
from helpers import Pretensioned, distorted
from scipy.sparse import identity
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Descent,
    Fabric,
    Force,
    Full,
    LoadStepper,
    Macro,
    Mixed,
    Newton,
    OnePoint,
    Ply,
    StepError,
    Term,
)
from skfem_textile.mesh.splitting import split
from skfem_textile.scenes import bias_extension, strip
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.linear import SOLVERS
from skfem_textile.solve.linear.solvers import superlu
from skfem_textile.solve.states import NoEquilibriumError

CLAMP = {"clamp": Condition("bottom")}


def pulled(value, **fabric):
    mesh = MeshQuad().refined(2).with_defaults()
    ply = Ply(mesh, Fabric(**{"tension": 10.0, "shear": 1.0, **fabric}), Full())
    return ply, CLAMP | {"pull": Condition("top", value, direction=(0, 1))}


class ShortSteps(Mixed):
    """Fails where the conditions move by more than 0.2, or late in the run."""

    def iterates(self, problem, start, fixed_values):
        if fixed_values.max() - np.abs(start.u).max() > 0.2:
            raise NoEquilibriumError("too long")
        return super().iterates(problem, start, fixed_values)


class ShyAtFirst(Mixed):
    """Fails beyond the first tenth of the way unless steps are short."""

    def iterates(self, problem, start, fixed_values):
        at = np.abs(start.u).max()
        if at < 0.05 and fixed_values.max() - at > 0.03:
            raise NoEquilibriumError("too long")
        return super().iterates(problem, start, fixed_values)


def load_factors(result):
    return [state.load_factor for state in result.states]


def test_a_uniform_pull_is_exact():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, steps=4).run()
    assert result.converged
    assert load_factors(result) == [0.0, 0.25, 0.5, 0.75, 1.0]
    force = 10.0 * np.log(1.5) / 1.5
    for name, sign in (("pull", 1), ("clamp", -1)):
        np.testing.assert_allclose(
            result.states[-1].reactions[name], [0, sign * force], atol=1e-7
        )
    assert result.summary()["energy"] == pytest.approx(5 * np.log(1.5) ** 2)


def test_reactions_do_the_work_of_the_energy():
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=40).run()
    rows = result.history()
    assert rows[-1]["work"] == pytest.approx(rows[-1]["energy"], rel=1e-3)
    assert rows[20]["work"] == pytest.approx(rows[20]["energy"], rel=1e-2)


def test_history_has_a_row_per_state_with_what_is_needed():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, steps=3).run()
    rows = result.history()
    assert len(rows) == 4
    assert rows[0]["energy"] == 0.0
    for row, state in zip(rows[1:], result.states[1:], strict=True):
        assert row["linear_solves"] == len(state.residuals) > 0
        assert row["residual"] <= row["tolerance"]
        assert row["pull_reaction_y"] > 0
        assert row["negative_pivots"] == 0
        assert row["min_det_F"] > 1
        assert row["energy"] == pytest.approx(
            row["tension_energy"] + row["shear_energy"] + row["stabilisation_energy"]
        )
    assert result.linear_solves == sum(row["linear_solves"] for row in rows)


def test_a_printed_result_is_a_table_of_its_states():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, steps=40).run()
    lines = str(result).splitlines()
    assert lines[0].split()[:2] == ["load", "factor"]
    assert [line.split()[0] for line in lines[1:-2]] == [
        f"{t:.4f}" for t in np.linspace(0, 1, 11)
    ]
    assert all(line.endswith("yes") for line in lines[1:-2])
    assert lines[-2].split()[:3] == ["…", "30", "more"]
    assert "converged at load factor 1, 40 steps" in lines[-1]


def test_a_printed_result_says_nothing_of_states_left_out_where_none_are():
    ply, conditions = pulled(0.5)
    assert "…" not in str(LoadStepper(ply, conditions, steps=10).run())


class Grip(Term):
    """A term of one's own that pulls all nodes to a place which moves with t."""

    def __init__(self, name, role):
        self.name, self.role = name, role

    def energy(self, u, t):
        return 0.5e-3 * float(((u - 0.01 * t) ** 2).sum())

    def residual(self, u, t):
        return 1e-3 * (u - 0.01 * t)

    def tangent(self, u, t):
        return 1e-3 * identity(len(u), format="csr")


@pytest.fixture
def sheet():
    """A way to run a square whose bottom is clamped, with further arguments."""

    def run(top, fabric=None, terms=(), held=None):
        mesh = MeshQuad().refined(2).with_defaults()
        ply = Ply(mesh, fabric or Fabric(10.0, 1.0), Full(), terms)
        conditions = held or {"bottom": Condition("bottom"), "top": top}
        return LoadStepper(ply, conditions, 2).run()

    return run


@pytest.mark.parametrize("top", [(0.0, 0.0), lambda X, t: 0 * X])
def test_a_run_in_which_nothing_moves_says_so_once(sheet, caplog, top):
    result = sheet(Condition("top", top))
    assert not np.any(result.u)
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert record.message.startswith("nothing will move: no condition prescribes")


def test_what_drives_a_run_is_not_taken_for_nothing(sheet, caplog):
    """Motions there and back, loads, tension at rest, a term of one's own."""
    clamp = Condition("top")
    there_and_back = Condition("top", lambda X, t: 0.04 * t * (1 - t) + 0 * X)
    sheet(there_and_back)
    sheet(clamp, terms=[BodyForce((0.0, 1e-3))])
    sheet(clamp, terms=[Force("top", (0.0, 1e-3))])  # the reaction tells of it
    sheet(clamp, Fabric(Pretensioned(10.0, 0.1), 1.0))
    sheet(clamp, terms=[Grip("grip", "internal")])
    assert "nothing will move" not in caplog.text


def test_the_one_strain_of_the_table_is_the_one_that_the_law_sees():
    scene = bias_extension(split(rectangle(50, 100, (2, 4), "irregular", 0.2)))
    ply = Ply(scene.mesh, Fabric(1e4, 0.5, scene.warp, scene.weft), Macro())
    result = LoadStepper(ply, scene.conditions, 2).run()
    head, *_, last, _ = str(result).splitlines()
    assert "fibre strain" in head
    assert head.count("strain") == 1
    seen = np.abs(ply.law_strain(result.u)).max()
    assert float(last.split()[3]) == pytest.approx(seen, rel=1e-2)
    row, summary = result.history()[-1], result.summary()
    assert row["max_fibre_strain"] == summary["max_fibre_strain"] == seen
    assert row["mesh_fibre_strain"] == summary["mesh_fibre_strain"] > 2 * seen
    assert result.history()[1]["max_fibre_strain"] < seen


def test_the_history_tells_how_far_the_nodes_of_a_condition_move():
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=2).run()
    top = ply.nodes[1] == 1.0
    for row, state in zip(result.history(), result.states, strict=True):
        assert row["clamp_displacement_x"] == row["clamp_displacement_y"] == 0.0
        assert row["pull_displacement_y"] == pytest.approx(0.15 * state.load_factor)
        free = ply.nodal(state.u)[0, top].mean()
        assert row["pull_displacement_x"] == pytest.approx(free)
    assert free != 0


def test_a_failed_step_is_halved_and_counted():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, 1, strategies=[ShortSteps()]).run()
    assert load_factors(result) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert result.steps_cut == result.summary()["steps_cut"] >= 2


def test_steps_grow_again_and_land_on_the_requested_load_factors():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, 5, strategies=[ShyAtFirst()]).run()
    reached = load_factors(result)
    assert set(np.linspace(0, 1, 6)) <= set(reached)
    assert np.diff(reached).min() < 0.06
    np.testing.assert_allclose(np.diff(reached)[-3:], 0.2)


def test_it_says_plainly_when_it_cannot_and_keeps_what_it_has():
    """A ply squeezed to nothing buckles, then folds: nothing is accepted past that."""
    ply, conditions = pulled(-1.5)
    with pytest.raises(
        StepError,
        match=r"stopped at load factor 0\.\d+ \(.* mm\): no acceptable state at 0\.",
    ) as e:
        LoadStepper(ply, conditions, steps=4, max_halvings=1).run()
    result = e.value.result
    assert not result.converged
    assert result.states[-1].load_factor >= 0.25
    assert result.linear_solves > sum(s.linear_solves for s in result.states)
    assert ply.area_ratio(result.u).min() > 0


def test_a_value_that_goes_wrong_on_the_way_keeps_what_was_computed():
    ply, conditions = pulled(
        lambda X, t: 0.5 * t + (np.nan if t == 0.75 else 0.0) * X[0]
    )
    stepper = LoadStepper(ply, conditions, 2, strategies=[ShortSteps()])
    with pytest.raises(StepError, match=r"not finite at load factor 0\.75") as error:
        stepper.run()
    assert error.value.result.states[-1].load_factor == 0.5


def test_linear_solves_include_abandoned_attempts():
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, 2, strategies=[Mixed(most=1), "mixed"]).run()
    linear_solves = [state.linear_solves for state in result.states]
    assert linear_solves[1] == len(result.states[1].residuals) + 1
    assert sum(linear_solves) == result.linear_solves


def test_the_verdict_costs_one_factorisation_a_run():
    """That of every state but the last serves the step after it."""
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=5).run()
    assert result.factorisations == result.linear_solves + 1


def test_a_mechanism_is_refused():
    mesh = MeshQuad().refined(2).with_defaults()
    ply = Ply(mesh, Fabric(10.0), Full())  # no shear stiffness, only one side held
    with pytest.raises(StepError, match="some motion meets no stiffness"):
        LoadStepper(
            ply, {"pull": Condition("top", 0.1, direction=(0, 1))}, steps=1
        ).run()


def test_a_ply_with_every_node_held_has_nothing_to_solve():
    mesh = MeshQuad()
    held = {"all": Condition(np.arange(4), lambda X, t: 0.1 * t * X)}
    for formulation in (Full(), OnePoint(1.0)):
        result = LoadStepper(Ply(mesh, Fabric(10.0, 1.0), formulation), held, 2).run()
        np.testing.assert_allclose(result.ply.nodal(result.u), 0.1 * mesh.p)
        assert result.summary()["stable"]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("direction", [None, (0.0, 1.0), (0.5, 1.0)])
def test_a_mechanism_on_an_irregular_mesh_is_no_stable_state(seed, direction):
    """Round-off gives free motions a little stiffness, of either sign."""
    mesh = distorted(seed).with_defaults()
    held = {"hinge": Condition([0], 0.0 * mesh.p[:, :1])}
    if direction:
        held = {"slide": Condition("bottom", 0.0, direction)}
    for formulation in (Full(), OnePoint(1.0)):
        ply = Ply(mesh, Fabric(1e4, 1.0, (1.0, 0.3), (0.0, 1.0)), formulation)
        with pytest.raises(StepError, match="some motion meets no stiffness"):
            LoadStepper(ply, held, steps=1).run()


@pytest.mark.parametrize(
    "steps", [0, -3, 2.5, np.nan, np.inf, "3", None, 10**6 + 1, 10**23]
)
def test_steps_that_nobody_can_mean_are_refused(steps):
    ply, conditions = pulled(0.5)
    with pytest.raises(ValueError, match="steps must be at least 1"):
        LoadStepper(ply, conditions, steps=steps)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"strategies": ["mixd"]}, "unknown strategy 'mixd': choose of mixed, descent"),
        ({"strategies": []}, "name at least one strategy"),
        ({"warn_only": ["stable"]}, "unknown check 'stable': choose of folding"),
        ({"max_halvings": -1}, "max_halvings must be a whole number from 0"),
        ({"strategies": [Mixed]}, "neither a strategy nor the name of one"),
        ({"strategies": [Mixed(most=0)]}, "at least one iteration"),
    ],
)
def test_unknown_options_are_refused(option, message):
    ply, conditions = pulled(0.5)
    with pytest.raises(ValueError, match=message):
        LoadStepper(ply, conditions, **option)


@pytest.mark.parametrize("E", [1e2, 1e6, 1e10])
def test_the_tolerance_can_be_met_at_any_stiffness(E):
    """On an aligned mesh the reactions vanish with the residual."""
    scene = strip("aligned", size=(4, 6))
    ply = Ply(scene.mesh, Fabric(E), Full())
    result = LoadStepper(ply, scene.conditions, steps=5).run()
    assert result.summary()["max_fibre_strain"] < 1e-9
    assert result.linear_solves < 40


def test_every_strategy_finds_the_same_equilibrium():
    scene = strip(size=(4, 6))
    ends = [
        LoadStepper(
            Ply(scene.mesh, Fabric(1e4), OnePoint(10.0)),
            scene.conditions,
            steps=10,
            strategies=[strategy],
        )
        .run()
        .u
        for strategy in ("mixed", "descent", "newton", Newton(30), Descent(200))
    ]
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], atol=1e-6)


def test_callbacks_are_told_every_iteration_and_every_state():
    ply, conditions = pulled(0.5)
    states, iterations = [], []
    result = LoadStepper(
        ply, conditions, 2, on_step=states.append, on_iteration=iterations.append
    ).run()
    assert states == result.states[1:]
    assert len(iterations) == result.linear_solves
    assert iterations[0].load_factor == iterations[0].step == 0.5
    assert iterations[0].strategy == "mixed"
    assert iterations[-1].residual <= iterations[-1].tolerance


def test_the_log_tells_iterations_and_steps(caplog):
    ply, conditions = pulled(0.5)
    with caplog.at_level(logging.DEBUG, logger="skfem_textile"):
        result = LoadStepper(ply, conditions, 1, strategies=[ShortSteps()]).run()
    levels = [record.levelno for record in caplog.records]
    assert levels.count(logging.DEBUG) == result.linear_solves
    assert "step to 1 failed, halved: no acceptable state at 1: too long" in caplog.text
    assert "load factor 0.25" in caplog.text


def test_an_error_of_a_callback_is_the_users():
    ply, conditions = pulled(0.5)
    stepper = LoadStepper(ply, conditions, 2, on_step=lambda state: int("x"))
    with pytest.raises(ValueError, match="invalid literal"):
        stepper.run()
    assert load_factors(stepper.result) == [0.0, 0.5]


def test_before_a_run_there_is_no_result():
    ply, conditions = pulled(0.5)
    stepper = LoadStepper(ply, conditions)
    assert stepper.states == ()
    with pytest.raises(RuntimeError, match="has not been run"):
        _ = stepper.result


@pytest.mark.parametrize("halvings", [0, 2])
def test_a_run_that_fails_counts_the_steps_that_it_cut(halvings):
    ply, conditions = pulled(lambda X, t: -1.5 * (t > 0) + 0 * X[0])
    with pytest.raises(StepError) as error:
        LoadStepper(ply, conditions, 1, max_halvings=halvings).run()
    assert error.value.result.steps_cut == halvings


def test_reactions_are_not_taken_for_unbalanced_forces():
    ply, conditions = pulled(0.5)
    problem = LoadStepper(ply, conditions).problem
    free, fixed = problem.constraints.free, problem.constraints.fixed
    f = problem.unfixed(np.ones(ply.basis.N), ply.basis.zeros())
    assert np.all(f[free] == 1)
    assert np.all(f[fixed] == 0)


def test_every_solve_and_factorisation_is_counted(monkeypatch):
    counts = {"factorisations": 0, "solves": 0}
    factorised = superlu._decomposed

    class Counted:
        def __init__(self, lu):
            self._lu = lu

        def __getattr__(self, name):
            return getattr(self._lu, name)

        def solve(self, b):
            counts["solves"] += 1
            return self._lu.solve(b)

    def counted(*arguments, **options):
        counts["factorisations"] += 1
        return Counted(factorised(*arguments, **options))

    monkeypatch.setattr(superlu, "_decomposed", counted)
    ply, conditions = pulled(-0.3)
    result = LoadStepper(ply, conditions, 2, max_halvings=2).run()
    assert result.linear_solves == counts["solves"]
    assert result.factorisations == counts["factorisations"]
    assert counts["solves"] > sum(len(state.residuals) for state in result.states)


def test_an_unknown_solver_is_refused_before_any_work():
    ply, conditions = pulled(0.5)
    with pytest.raises(ValueError, match="unknown solver 'umfpack': choose of auto"):
        LoadStepper(ply, conditions, solver="umfpack")


@cache
def pushed_by(solver):
    """A ply that is indefinite on the way."""
    result = LoadStepper(*pulled(-0.3), 2, max_halvings=2, solver=solver).run()
    assert result.states[-1].verdict.negative_pivots == 0
    return result.u


@pytest.mark.parametrize("solver", ["cholmod", "pardiso"])
def test_every_solver_leads_to_the_same_end(solver):
    pytest.importorskip(SOLVERS[solver].package)
    np.testing.assert_allclose(pushed_by(solver), pushed_by("superlu"), atol=1e-9)


def test_an_interrupted_run_keeps_its_states():
    ply, conditions = pulled(0.5)

    def interrupt(state):
        if state.load_factor == 0.5:
            raise KeyboardInterrupt

    stepper = LoadStepper(ply, conditions, 4, on_step=interrupt)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    assert load_factors(stepper.result) == [0.0, 0.25, 0.5]
    assert not stepper.result.converged


def interrupt_at(number):
    """Interrupt the library at its call of that number, from now on."""
    calls = count()

    def interrupt(frame, event, argument):
        of_library = frame.f_globals.get("__name__", "").startswith("skfem_textile")
        if event == "call" and of_library and next(calls) == number:
            sys.setprofile(None)
            raise KeyboardInterrupt

    sys.setprofile(interrupt)


@pytest.mark.parametrize("number", range(0, 100, 7))
def test_a_run_may_be_interrupted_wherever_it_begins(number):
    ply, conditions = pulled(0.5)
    stepper = LoadStepper(ply, conditions, 1)
    interrupt_at(number)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    assert stepper.run().converged


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"strategies": "mixed"}, "strategies must be given as a list, of mixed, "),
        ({"strategies": None}, "strategies must be given as a list"),
        ({"warn_only": "work"}, "checks in warn_only must be given as a list"),
        ({"warn_only": None}, "checks in warn_only must be given as a list"),
        ({"warn_only": [[]]}, r"unknown check \[\]"),
        ({"solver": ["auto"]}, "unknown solver"),
        ({"max_halvings": 1.5}, "max_halvings must be a whole number from 0 to 30"),
        ({"max_halvings": np.nan}, "max_halvings must be a whole number"),
        ({"max_halvings": 10**6}, "max_halvings must be a whole number"),
        ({"max_halvings": None}, "max_halvings must be a whole number"),
        ({"on_step": 3}, "on_step must be a function, not 3"),
        ({"on_iteration": "print"}, "on_iteration must be a function"),
        ({"checkpoint": 3}, "checkpoint must be a folder, not 3"),
        ({"checkpoint": "a\0b"}, "checkpoint 'a.x00b' is no path"),
        ({"ply": None}, "ply must be a Ply, not NoneType"),
    ],
)
def test_settings_of_another_kind_are_refused_before_the_run(setting, message):
    mesh = MeshQuad().refined(1).with_defaults()
    given = {"ply": Ply(mesh, Fabric(1e4, 1.0), Full())} | setting
    with pytest.raises(ValueError, match=message):
        LoadStepper(conditions={"clamp": Condition("bottom")}, **given)


def test_a_function_that_fails_on_the_way_stops_the_run():
    """At a load factor that only halving reaches."""

    def value(X, t):
        return np.full(X.shape[1], 1.5 * t if t in (0, 1) else {}["x\ny"])

    mesh = MeshQuad().refined(1).with_defaults()
    stepper = LoadStepper(
        Ply(mesh, Fabric(1e4, 1.0), Full()),
        {"clamp": Condition("bottom"), "c": Condition("top", value, (0, -1))},
        steps=1,
    )
    with pytest.raises(StepError, match=r"'c': the value fails: KeyError 'x.ny'$"):
        stepper.run()


@pytest.mark.parametrize("size", [1.0, 50.0])
@pytest.mark.parametrize("E", [1e4, 1e7])
@pytest.mark.parametrize("n", [8, 16])
def test_what_round_off_leaves_is_within_the_tolerance(n, E, size):
    """Under a load that is hardly more than round-off."""
    ply = Ply(rectangle(size, size, (n, n), "irregular", 0.2), Fabric(E, 0.5))
    weight = BodyForce((0.0, -1e-9), factor=1.0)
    stepper = LoadStepper(
        ply.with_terms(weight), {"clamp": Condition("bottom")}, 1, strategies=("mixed",)
    )
    assert stepper.run().linear_solves <= 2
