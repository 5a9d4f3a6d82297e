"""Limit points of loads: reported where the load passes them, and nowhere else."""

import re
from functools import cache

import numpy as np
import pytest
from skfem import (
    MeshQuad,
)

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Force,
    Full,
    LoadStepper,
    Newton,
    OnePoint,
    Ply,
    Sin2,
    Traction,
)
from tests.helpers.random_plies import Crimped

CLAMP = {"clamp": Condition("bottom")}


@pytest.mark.parametrize("steps", [1, pytest.param(7, marks=pytest.mark.slow)])
def test_a_load_is_limited_by_the_peak_of_the_tension(steps):
    """A law with a peak of T/λ: exact, on one element."""

    class Softening:
        def energy(self, x):
            return 1e3 * 0.1 * (0.1 - (0.1 + x) * np.exp(-x / 0.1))

        def value(self, x):
            return 1e3 * x * np.exp(-x / 0.1)

        def tangent(self, x):
            return 1e3 * (1 - x / 0.1) * np.exp(-x / 0.1)

    peak = 1 / (1 / 0.1 + 1)
    limit = 1e3 * peak * np.exp(-1.0)
    ply = Ply(MeshQuad().with_defaults(), Fabric(Softening(), 1.0), Full())
    ply = ply.with_terms(Force("right", (3 * limit, 0.0)))
    rollers = {
        "held": Condition("left", 0.0, direction=(1, 0)),
        "below": Condition("bottom", 0.0, direction=(0, 1)),
        "above": Condition("top", 0.0, direction=(0, 1)),
    }
    stepper = LoadStepper(ply, rollers, steps)
    with pytest.raises(RuntimeError, match="the load exceeds a limit") as stopped:
        stepper.run()
    largest = 3 * stopped.value.result.states[-1].load_factor
    assert 0.99 < largest <= 1.0


def coarse(fabric, formulation, loads=(), halvings=2):
    """A square ply with sides of 10 mm."""
    mesh = MeshQuad().refined(halvings).scaled(10.0).with_defaults()
    return Ply(mesh, fabric, formulation, loads)


#: A square sheared by a force along its top: the largest force for the sin² law.
SIDEWAYS = np.array([1.0, -1.0]) / np.sqrt(2)


def sheared_by(total, factor):
    fabric, load = Fabric(1e3, Sin2(0.5)), Force("top", total * SIDEWAYS, factor)
    return coarse(fabric, Full(), [load], halvings=1)


@cache
def ramped_limit():
    """The load factor at which a ramped load of 3.75 N passes its limit."""
    ramped = sheared_by(3.75, lambda t: t)
    with pytest.raises(RuntimeError, match="the load exceeds a limit") as stopped:
        LoadStepper(ramped, CLAMP, 2).run()
    return stopped.value.result.states[-1].load_factor


@pytest.mark.parametrize(
    "factor",
    [
        pytest.param(
            lambda t: 1 - abs(2 * t - 1),
            marks=pytest.mark.dear("finds the limit twice, to a percent"),
        ),
        *(
            pytest.param(factor, marks=pytest.mark.slow)
            for factor in (lambda t: 4 * t * (1 - t), lambda t: t**8)
        ),
    ],
    ids=["there and back", "parabola", "late"],
)
@pytest.mark.parametrize("steps", [4, pytest.param(10, marks=pytest.mark.slow)])
def test_a_limit_point_is_reported_for_any_later_load(factor, steps):
    """To a percent of the load; no step passes it to the state on its other side."""
    ply = sheared_by(3.75, factor)
    with pytest.raises(RuntimeError, match="the load exceeds a limit") as stopped:
        LoadStepper(ply, CLAMP, steps).run()
    low, high = map(
        float, re.findall(r"factors (\S+) and (\S+): ", str(stopped.value))[0]
    )
    assert factor(low) == pytest.approx(ramped_limit(), rel=0.01)
    assert factor(high) == pytest.approx(factor(low), rel=0.01)


@pytest.mark.parametrize("halvings", [1, pytest.param(6, marks=pytest.mark.slow)])
def test_a_limit_point_close_to_the_end_of_a_step_is_reported(halvings):
    ply = sheared_by(1.01 * 3.75 * ramped_limit(), lambda t: t)
    with pytest.raises(RuntimeError, match="the load exceeds a limit"):
        LoadStepper(ply, CLAMP, 2, max_halvings=halvings).run()


@pytest.mark.parametrize("formulation", [Full(), OnePoint()], ids=repr)
def test_a_constant_load_is_not_a_limit_point(formulation):
    """Its work without motion is round-off."""
    ply = coarse(Fabric(1e3, 1.0), formulation)
    held = Force("top", (1.0, 2.0), factor=lambda t: min(1.0, 2 * t))
    assert LoadStepper(ply.with_terms(held), CLAMP, 2).run().converged
    on_clamp = BodyForce((0.01, -0.02), factor=1.0), Traction("bottom", (0.0, 1.0))
    assert LoadStepper(ply.with_terms(*on_clamp), CLAMP, 2).run().converged


def test_a_load_beyond_the_limit_at_rest_is_rejected():
    with pytest.raises(RuntimeError, match="loads that grow with the load factor"):
        LoadStepper(sheared_by(3.75, 1.0), CLAMP, 2, method=Newton(most=2)).run()


def test_a_ply_without_stiffness_at_rest_supports_a_load():
    ply = coarse(Fabric(1e3, Crimped(1e3)), Full(), [Force("top", (50.0, 0.0))])
    result = LoadStepper(ply, CLAMP, 2).run()
    assert result.converged
    forces = result.states[-1].reactions["clamp"]
    np.testing.assert_allclose(forces, [-50.0, 0.0], atol=1e-9)
