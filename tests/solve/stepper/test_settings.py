"""Settings of a run that nobody can mean are refused before it begins."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, Newton, Ply
from tests.helpers.pulled import pulled


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
        ({"method": "newtn"}, "unknown method 'newtn': choose of newton, plain"),
        ({"warn_only": ["stable"]}, "unknown check 'stable': choose of folding"),
        ({"max_halvings": -1}, "max_halvings must be a whole number from 0"),
        ({"method": Newton}, "neither a nonlinear solver nor its name"),
        ({"method": Newton(most=0)}, "at least one iteration"),
    ],
)
def test_unknown_options_are_refused(option, message):
    ply, conditions = pulled(0.5)
    with pytest.raises(ValueError, match=message):
        LoadStepper(ply, conditions, **option)


def test_before_a_run_there_is_no_result():
    ply, conditions = pulled(0.5)
    stepper = LoadStepper(ply, conditions)
    assert stepper.states == ()
    with pytest.raises(RuntimeError, match="has not been run"):
        _ = stepper.result


def test_an_unknown_solver_is_refused_before_any_work():
    ply, conditions = pulled(0.5)
    with pytest.raises(ValueError, match="unknown solver 'umfpack': choose of auto"):
        LoadStepper(ply, conditions, solver="umfpack")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"method": ["newton"]}, "neither a nonlinear solver nor its name"),
        ({"method": None}, "None is neither a nonlinear solver nor its name"),
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
