"""Steps of a run: halving, errors of users, and the path that they follow."""

import json
import logging
import sys
from dataclasses import asdict, replace
from itertools import count

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    Full,
    Linear,
    LoadStepper,
    Macro,
    Newton,
    OnePoint,
    Ply,
    Pretensioned,
    Quadratic,
    Sin2,
    StepError,
)
from skfem_textile.ply.terms import Term
from skfem_textile.scenes import bias_extension, strip
from skfem_textile.solve.continuation import Continuation, loads_drive
from skfem_textile.solve.states import NoEquilibriumError, State, UserError, Verdict
from skfem_textile.solve.verdict import CHECKS
from tests.helpers import Locking
from tests.helpers.pulled import CLAMP, ShortSteps, load_factors, pulled
from tests.helpers.tools import problem_of

# Steps: halved on failure, increased again, and stops of a run


class LimitedAtFirst(Newton):
    """Fails beyond the first tenth of the path unless steps are short."""

    def solve(self, attempt, start):
        at = np.abs(start.u).max()
        if at < 0.05 and attempt.fixed_values.max() - at > 0.03:
            raise NoEquilibriumError("too long")
        return super().solve(attempt, start)


def test_a_failed_step_is_halved_and_counted():
    result = LoadStepper(*pulled(0.5), 1, method=ShortSteps()).run()
    assert load_factors(result) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert result.steps_cut == result.summary()["steps_cut"] >= 2


def test_parts_of_equal_length_have_their_numbers_of_steps():
    reached = load_factors(LoadStepper(*pulled(0.1), (4, 1, 2)).run())
    parts = [np.linspace(0, 1 / 3, 5), [2 / 3], [5 / 6, 1]]
    np.testing.assert_allclose(reached, np.concatenate(parts), rtol=1e-14)


def test_a_sequence_of_one_number_is_this_number():
    one, other = (LoadStepper(*pulled(0.1), steps).run() for steps in (3, [3]))
    assert load_factors(one) == load_factors(other)
    assert np.array_equal(one.u, other.u)


def test_a_step_that_was_halved_keeps_its_share_in_the_next_part():
    path = Continuation(longest=0.1, halvings=8, follows_path=True, next=0.025)
    path.enter(0.5)
    assert (path.longest, path.next) == (0.5, 0.125)


def test_steps_grow_again_and_land_on_the_requested_load_factors():
    reached = load_factors(LoadStepper(*pulled(0.5), 5, method=LimitedAtFirst()).run())
    assert set(np.linspace(0, 1, 6)) <= set(reached)
    assert np.diff(reached).min() < 0.06
    np.testing.assert_allclose(np.diff(reached)[-3:], 0.2)


def test_a_run_that_cannot_continue_reports_it_and_keeps_its_states():
    """A squeezed ply buckles; few iterations do not find it folded."""
    mesh = MeshQuad().refined(1).with_defaults()
    ply = Ply(mesh, Fabric(10.0, 1.0), Full())
    conditions = CLAMP | {"push": Condition("top", -2.0, (0, 1))}
    words = r"stopped at load factor 0\.\d+ \(.* mm\): no acceptable state at load"
    with pytest.raises(StepError, match=words) as e:
        LoadStepper(ply, conditions, 4, max_halvings=0, method=Newton(most=4)).run()
    result = e.value.result
    assert not result.converged
    assert result.states[-1].load_factor >= 0.25
    assert result.linear_solves > sum(s.linear_solves for s in result.states)
    assert result.ply.area_ratio(result.u).min() > 0


def test_an_invalid_intermediate_value_ends_the_run_and_keeps_its_states():
    def value(X, t):
        return 0.5 * t + (np.nan if t == 0.75 else 0.0) * X[0]

    words = r"mm\): condition 'pull': the value is not finite at load factor 0\.75$"
    with pytest.raises(StepError, match=words) as error:
        LoadStepper(*pulled(value), 2, method=ShortSteps()).run()
    assert error.value.result.states[-1].load_factor == 0.5


class StuckBeyondHalf(Newton):
    def solve(self, attempt, start):
        if attempt.fixed_values.max() > 0.25:
            raise NoEquilibriumError("stuck")
        return super().solve(attempt, start)


@pytest.mark.parametrize("halvings", [0, 2])
def test_a_run_that_fails_counts_the_steps_that_it_cut(halvings):
    options = {"method": StuckBeyondHalf(), "max_halvings": halvings}
    with pytest.raises(StepError) as error:
        LoadStepper(*pulled(0.5), 2, **options).run()
    assert error.value.result.steps_cut == halvings
    assert load_factors(error.value.result) == [0.0, 0.5]


def test_an_interrupted_run_keeps_its_states():
    def interrupt(state):
        if state.load_factor == 0.5:
            raise KeyboardInterrupt

    stepper = LoadStepper(*pulled(0.5), 4, on_step=interrupt)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    assert load_factors(stepper.result) == [0.0, 0.25, 0.5]
    assert not stepper.result.converged


def interrupt_at(number):
    """Interrupt the library at its call with that number, counted from now."""
    calls = count()

    def interrupt(frame, event, argument):
        of_library = frame.f_globals.get("__name__", "").startswith("skfem_textile")
        if event == "call" and of_library and next(calls) == number:
            sys.setprofile(None)
            raise KeyboardInterrupt

    sys.setprofile(interrupt)


@pytest.mark.parametrize("number", range(0, 78, 11))
def test_a_run_may_be_interrupted_during_its_start(number):
    stepper = LoadStepper(*pulled(0.5), 1)
    interrupt_at(number)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    assert stepper.run().converged


def test_no_result_exists_before_a_run():
    stepper = LoadStepper(*pulled(0.5))
    assert stepper.states == ()
    with pytest.raises(RuntimeError, match="has not been run"):
        _ = stepper.result


# An error in a user's function ends the run in one line and keeps its result


class Failing(Term):
    """No force, and an error beyond half of the load."""

    name, role = "failing", "internal"

    def energy(self, u, t, p):
        return 0.0

    def residual(self, u, t, p):
        if 0.5 < t < 1.0:  # the ply evaluates it at 1
            raise KeyError("table\nof temperatures")
        return 0.0 * u

    def tangent(self, u, t, p):
        return None


def test_a_term_that_raises_ends_the_run_and_keeps_earlier_states():
    ply, conditions = pulled(0.3)
    stepper = LoadStepper(ply.with_terms(Failing()), conditions, 4)
    words = r"at load factor 0.5.*KeyError: 'table\\nof temperatures' \(residual, line"
    with pytest.raises(StepError, match=words) as caught:
        stepper.run()
    assert load_factors(caught.value.result)[-1] == 0.5
    assert "\n" not in str(caught.value)


def test_a_term_that_raises_is_not_checkpoint_damage(tmp_path, monkeypatch):
    ply, conditions = pulled(0.3)
    ply = ply.with_terms(Failing())
    monkeypatch.setattr(Failing, "residual", lambda self, u, t, p: 0.0 * u)
    LoadStepper(ply, conditions, 4, checkpoint=tmp_path).run()

    def energy(self, u, t, p):
        return {}["missing"] if t == 0.25 else 0.0

    monkeypatch.setattr(Failing, "energy", energy)
    with pytest.raises(UserError, match="KeyError: 'missing' \\(energy, line"):
        LoadStepper(ply, conditions, 4, checkpoint=tmp_path).run(resume=True)


def test_a_callback_cannot_change_a_state():
    def spoil(state):
        state.u.fill(0)

    stepper = LoadStepper(*pulled(0.3), 2, on_step=spoil)
    with pytest.raises(StepError, match=r"ValueError: .*read-only"):
        stepper.run()
    assert np.abs(stepper.result.u).max() > 0.1


# Another number of steps leads to the same equilibrium, or the result reports it


def loaded(scene, formulation, steps, shear=0.0, tension=1e4, **options):
    fabric = Fabric(tension, shear, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, formulation or Macro())
    return LoadStepper(ply, scene.conditions, steps, **options).run()


@pytest.mark.slow
def test_the_strip_has_the_same_final_state_for_any_number_of_steps():
    """Without a path, 2 steps ended at 1.790 N·mm and 20 at 1.265."""
    results = [loaded(strip(), OnePoint(1.0), steps) for steps in (1, 2)]
    for result in results:
        assert result.path_resolved
        assert result.states[-1].verdict.stable
        assert energy_of(result) == pytest.approx(1.2650745, rel=1e-6)
        reaction = result.states[-1].forces["right"][0]
        assert reaction == pytest.approx(3.06595, rel=1e-4)


@pytest.mark.parametrize(
    ("scene", "steps"), [(strip(size=(5, 8)), 6), (bias_extension(size=(4, 8)), 1)]
)
def test_an_easy_path_has_no_extra_cost(scene, steps, monkeypatch):
    result = loaded(scene, Full(), steps, 0.5)
    assert result.path_resolved
    monkeypatch.setattr(Continuation, "most_projected", lambda *_: np.inf)
    monkeypatch.setattr(Continuation, "accepts", lambda *_: True)
    assert loaded(scene, Full(), steps, 0.5).linear_solves == result.linear_solves


@pytest.mark.parametrize(
    ("formulation", "law", "degrees"),
    [
        (OnePoint(), Sin2(0.5), 60.0),
        pytest.param(Macro(), Locking(0.5, 0.6), 30.0, marks=pytest.mark.slow),
        pytest.param(Macro(), Sin2(0.5), 60.0, marks=pytest.mark.slow),
        pytest.param(Macro(), Linear(0.5), 60.0, marks=pytest.mark.slow),
        pytest.param(OnePoint(), Locking(0.5, 0.3), 15.5, marks=pytest.mark.slow),
    ],
)
def test_load_and_energy_are_independent_of_the_step_size(formulation, law, degrees):
    """C_s and E_d follow the state, or a run reports that its path is in doubt."""
    scene = bias_extension(size=(3, 6), shear_angle=np.radians(degrees))
    few, more, many = (loaded(scene, formulation, n, law) for n in (1, 4, 8))
    assert many.path_resolved
    assert more.path_resolved
    for result in (few, more):
        if result.path_resolved:
            assert load_of(result) == pytest.approx(load_of(many), rel=0.005)
            assert energy_of(result) == pytest.approx(energy_of(many), rel=0.005)


def load_of(result):
    return result.states[-1].reactions["top"][1]


def energy_of(result):
    return result.history()[-1]["energy"]


def test_energy_is_independent_of_the_number_of_steps_if_reactions_cancel():
    """One condition fixes both ends: the sum of its forces is zero."""
    scene = bias_extension(size=(2, 4), shear_angle=np.radians(50))
    ends = [scene.mesh.p[1].min(), scene.mesh.p[1].max()]
    held = Condition(
        lambda X: np.isin(X[1], ends),
        lambda X, t: np.where(X[1] == ends[1], scene.displacement(X, t), 0.0),
    )
    scene = replace(scene, conditions={"ends": held})
    one, eight = (loaded(scene, Quadratic(80.0), n, Sin2(0.5)) for n in (1, 8))
    assert one.path_resolved
    assert energy_of(one) == pytest.approx(energy_of(eight), rel=0.005)


def test_a_reaction_along_stiff_fibres_is_independent_of_the_number_of_steps():
    """If the energy changes by a thousandth, the reaction changes by a tenth."""
    scene, tension = strip(size=(3, 4)), Pretensioned(Linear(1e5), 1.0)
    few, many = (loaded(scene, None, n, 0.5, tension) for n in (2, 5))
    reactions = [np.array([*r.states[-1].forces.values()]) for r in (few, many)]
    assert few.path_resolved
    assert np.abs(reactions[0] - reactions[1]).max() < 0.005 * np.abs(reactions).max()


def test_energy_is_independent_of_the_load_history():
    """Up to 60 degrees and back to 6, and straight to 6."""
    scene = bias_extension(size=(2, 4), seed=0, shear_angle=np.radians(60))

    def pulled(path, steps):
        top = Condition("top", lambda X, t: scene.displacement(X, path(t)))
        conditions = scene.conditions | {"top": top}
        return loaded(replace(scene, conditions=conditions), Macro(), steps, 0.5)

    back = pulled(lambda t: min(2 * t, 1.9 - 1.8 * t), 6)
    straight = pulled(lambda t: 0.1 * t, 2)
    assert back.path_resolved
    assert energy_of(back) == pytest.approx(energy_of(straight), rel=0.005)
    assert load_of(back) == pytest.approx(load_of(straight), rel=0.005)


def test_a_released_ply_has_no_energy_and_no_warning(caplog):
    scene = bias_extension(size=(4, 8))
    top = Condition("top", lambda X, t: scene.displacement(X, 1 - abs(2 * t - 1)))
    scene = replace(scene, conditions=scene.conditions | {"top": top})
    with caplog.at_level(logging.WARNING, logger="skfem_textile"):
        result = loaded(scene, Macro(), 4, 0.5)
    assert result.path_resolved
    assert abs(energy_of(result)) < 1e-9 * result.history()[2]["energy"]
    assert not caplog.records


def test_the_papers_rates_depend_on_the_number_of_steps():
    assert not loaded(strip(size=(3, 4)), OnePoint(10.0, "rate"), 4).path_resolved


def state(t, energy, force):
    """A state with an energy and a force at a load factor."""
    verdict, energies = Verdict(0, 1.0, 0.0, 0.0, 0.0), {"tension": energy}
    arguments = t, np.zeros(4), {}, {}, energies, 1, (), 0.0, verdict
    return State(*arguments, forces={"top": np.array([0.0, force])})


@pytest.mark.parametrize(
    ("energy", "force", "projected", "resolved"),
    [
        (1.009, 2.0, 2, True),
        (1.02, 2.0, 2, False),
        (1.0, 2.03, 2, False),
        (1.0, 2.0, 3, False),
    ],
)
def test_a_hard_step_must_agree_with_its_halves_within_1_per_cent(
    energy, force, projected, resolved
):
    path, step = Continuation(1.0, 8, True, next=1.0), 2.0**-6
    assert not path.accepts(step, state(step, 1.0, 2.0), projected=3, settled=True)
    assert path.end(0.0, 1.0) == path.next == step / 2
    assert path.accepts(step / 2, state(step / 2, 0.5, 1.0), projected, settled=True)
    path.next = 1.0
    assert path.end(step / 2, 1.0) == step
    assert path.accepts(step / 2, state(step, energy, force), projected=0, settled=True)
    assert (not path.unresolved) == resolved
    assert path.end(step, 1.0) == 1.0


def test_a_path_is_saved_and_resumed():
    path = Continuation(1.0, 8, True, next=1.0, unresolved=[0.5])
    path.accepts(2.0**-6, state(2.0**-6, 1.0, 2.0), projected=3, settled=True)
    assert path.to_compare
    assert Continuation.of(json.loads(json.dumps(asdict(path)))) == path


def test_a_method_without_difficulty_measure_leaves_the_path_unresolved():
    scene = strip(size=(2, 3), seed=0)
    options = {"method": "plain", "warn_only": list(CHECKS)}
    assert not loaded(scene, OnePoint(1.0), 1, **options).path_resolved


@pytest.mark.parametrize(("share", "drives"), [(1.9, True), (2.1, False)])
def test_loads_drive_a_ply_if_their_work_is_half_of_its_energy(share, drives):
    ply, conditions = pulled(0.5)
    ply = ply.with_terms(Force("right", (1.0, 0.0)))
    u, problem = np.full(ply.basis.N, 0.01), problem_of(ply, conditions).at(1.0)
    energies = {"tension": share * float(ply.load(u, 1.0) @ u)}
    assert loads_drive(problem, u, ply.parameters_at_rest, energies) == drives


def test_a_run_shows_load_factor_travel_iteration_unknowns_and_what_is_left():
    ply = Ply(MeshQuad().refined(1).with_defaults(), Fabric(1e4, 0.5))
    pull = Condition("top", 0.02, (0, 1))
    lines = []
    stepper = LoadStepper(
        ply,
        {"clamp": Condition("bottom"), "pull": pull},
        4,
        on_iteration=lambda _: lines.append(stepper._run.progress()),
    )
    unknowns = f"{ply.basis.N} unknowns"
    assert stepper._run.progress() == f"analysing {unknowns}"
    stepper.run()
    assert lines[0] == (
        f"load factor 0 (moved by 0 mm), iteration 1 to 0.25, 4 steps left, {unknowns}"
    )
    start, end = lines[-1].split(" to 1, 0:00:0")
    u = np.linalg.norm(stepper.states[-2].displacements["pull"])
    assert start.startswith(f"load factor 0.75 (moved by {u:.4g} mm), iteration ")
    assert end.endswith(f" left, {unknowns}")
    assert "iteration" not in stepper._run.progress()
