"""A user's function that raises ends the run in one line, with the result so far."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, Linear, LoadStepper, Ply, StepError
from skfem_textile.ply.terms import Term
from skfem_textile.solve.states import UserError
from tests.helpers.pulled import CLAMP, load_factors, pulled


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


class FailingLaw(Linear):
    """A shear law that raises once it is made to."""

    failing = False

    def value(self, x):
        if FailingLaw.failing:
            raise ZeroDivisionError
        return super().value(x)


def late(X, t):
    if t > 0.5:
        raise OSError("no such file")
    return np.stack([0.3 * t + 0 * X[0], 0 * X[0]])


def test_a_term_that_raises_ends_the_run_with_the_states_before():
    ply, conditions = pulled(0.3)
    stepper = LoadStepper(ply.with_terms(Failing()), conditions, 4)
    words = r"at load factor 0.5.*KeyError: 'table\\nof temperatures' \(residual, line"
    with pytest.raises(StepError, match=words) as caught:
        stepper.run()
    assert load_factors(caught.value.result)[-1] == 0.5
    assert "\n" not in str(caught.value)


def test_a_term_that_raises_is_no_damage_of_a_checkpoint(tmp_path, monkeypatch):
    ply, conditions = pulled(0.3)
    ply = ply.with_terms(Failing())
    monkeypatch.setattr(Failing, "residual", lambda self, u, t, p: 0.0 * u)
    LoadStepper(ply, conditions, 4, checkpoint=tmp_path).run()

    def energy(self, u, t, p):
        return {}["missing"] if t == 0.25 else 0.0

    monkeypatch.setattr(Failing, "energy", energy)
    with pytest.raises(UserError, match="KeyError: 'missing' \\(energy, line"):
        LoadStepper(ply, conditions, 4, checkpoint=tmp_path).run(resume=True)


def test_a_law_that_raises_ends_the_run_with_the_states_before(monkeypatch):
    mesh = MeshQuad().refined(2).with_defaults()
    ply = Ply(mesh, Fabric(10.0, FailingLaw(1.0)), Full())

    def fail(state):
        monkeypatch.setattr(FailingLaw, "failing", state.load_factor >= 0.5)

    conditions = CLAMP | {"pull": Condition("top", (0.4, 0.0))}
    stepper = LoadStepper(ply, conditions, 4, on_step=fail)
    words = r"at load factor 0.5.*: ZeroDivisionError \(value, line"
    with pytest.raises(StepError, match=words):
        stepper.run()
    assert stepper.states[-1].load_factor == 0.5


def test_a_callback_that_raises_ends_the_run_with_the_state_it_received():
    def stop(state):
        if state.load_factor >= 0.5:
            raise LookupError("seen enough")

    stepper = LoadStepper(*pulled(0.3), 4, on_step=stop)
    with pytest.raises(StepError, match="LookupError: seen enough \\(stop, line"):
        stepper.run()
    assert stepper.states[-1].load_factor == 0.5


def test_a_condition_that_raises_late_ends_the_run_with_the_states_before():
    ply, _ = pulled(0.3)
    conditions = CLAMP | {"pull": Condition("top", (0.3, 0.0))}
    stepper = LoadStepper(ply, conditions, 4)
    raised = stepper.problem.constraints.fixed_values

    def fixed_values(t):
        if t > 0.5:
            late(np.zeros((2, 1)), t)
        return raised(t)

    stepper.problem.constraints.fixed_values = fixed_values
    with pytest.raises(StepError, match="OSError: no such file \\(late, line"):
        stepper.run()
    assert stepper.states[-1].load_factor == 0.5


def test_a_callback_cannot_change_a_state():
    def spoil(state):
        state.u.fill(0)

    stepper = LoadStepper(*pulled(0.3), 2, on_step=spoil)
    with pytest.raises(StepError, match=r"ValueError: .*read-only"):
        stepper.run()
    assert np.abs(stepper.result.u).max() > 0.1
