"""Steps: halved where they fail, grown again, and what stops a run."""

import sys
from itertools import count

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, Newton, Ply, StepError
from skfem_textile.solve.states import NoEquilibriumError
from tests.helpers.pulled import ShortSteps, load_factors, pulled


class ShyAtFirst(Newton):
    """Fails beyond the first tenth of the way unless steps are short."""

    def solve(self, problem, start, fixed_values, most_altered, report):
        at = np.abs(start.u).max()
        if at < 0.05 and fixed_values.max() - at > 0.03:
            raise NoEquilibriumError("too long")
        return super().solve(problem, start, fixed_values, most_altered, report)


def test_a_failed_step_is_halved_and_counted():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, 1, method=ShortSteps()).run()
    assert load_factors(result) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert result.steps_cut == result.summary()["steps_cut"] >= 2


def test_steps_grow_again_and_land_on_the_requested_load_factors():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, 5, method=ShyAtFirst()).run()
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
    stepper = LoadStepper(ply, conditions, 2, method=ShortSteps())
    with pytest.raises(StepError, match=r"not finite at load factor 0\.75") as error:
        stepper.run()
    assert error.value.result.states[-1].load_factor == 0.5


@pytest.mark.parametrize("halvings", [0, 2])
def test_a_run_that_fails_counts_the_steps_that_it_cut(halvings):
    ply, conditions = pulled(lambda X, t: -1.5 * (t > 0) + 0 * X[0])
    with pytest.raises(StepError) as error:
        LoadStepper(ply, conditions, 1, max_halvings=halvings).run()
    assert error.value.result.steps_cut == halvings


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


@pytest.mark.parametrize("number", range(0, 78, 7))
def test_a_run_may_be_interrupted_wherever_it_begins(number):
    ply, conditions = pulled(0.5)
    stepper = LoadStepper(ply, conditions, 1)
    interrupt_at(number)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    assert stepper.run().converged


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
