"""Steps of a run: settings, halving, errors of users, messages."""

import sys
from itertools import count

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, Newton, Ply, StepError
from skfem_textile.ply.terms import Term
from skfem_textile.solve.states import NoEquilibriumError, UserError
from tests.helpers.pulled import CLAMP, ShortSteps, load_factors, pulled

# Steps: halved on failure, increased again, and stops of a run


class LimitedAtFirst(Newton):
    """Fails beyond the first tenth of the path unless steps are short."""

    def solve(self, problem, start, fixed_values, *others):
        at = np.abs(start.u).max()
        if at < 0.05 and fixed_values.max() - at > 0.03:
            raise NoEquilibriumError("too long")
        return super().solve(problem, start, fixed_values, *others)


def test_a_failed_step_is_halved_and_counted():
    result = LoadStepper(*pulled(0.5), 1, method=ShortSteps()).run()
    assert load_factors(result) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert result.steps_cut == result.summary()["steps_cut"] >= 2


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
    def solve(self, problem, start, fixed_values, *others):
        if fixed_values.max() > 0.25:
            raise NoEquilibriumError("stuck")
        return super().solve(problem, start, fixed_values, *others)


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
