"""Laws with inconsistent parts are rejected, all others are accepted."""

import math

import numpy as np
import pytest
from scipy.interpolate import PPoly

from skfem_textile import Fabric, Linear
from skfem_textile.fabric.law_check import check_laws
from tests.helpers import refused


class Made:
    """A law of three functions."""

    def __init__(self, energy, value, tangent, domain=None):
        self.energy, self.value, self.tangent = energy, value, tangent
        if domain is not None:
            self.domain = domain


E = 1e3


def linear(**other):
    """T = E ε, with some parts replaced."""
    parts = {
        "energy": lambda x: 0.5 * E * x**2,
        "value": lambda x: E * x,
        "tangent": lambda x: E + 0 * x,
    }
    return Made(**parts | other)


def piecewise(knots, slopes):
    """A tension that is linear between knots."""
    tangent = PPoly(slopes[None], knots)
    return Made(tangent.antiderivative(2), tangent.antiderivative(), tangent)


def in_each_element(shape):
    """A stiffness for each element, on arrays of one shape alone."""
    stiffness = np.arange(1.0, 1.0 + shape[0])[:, None]

    def own(x):
        assert x.shape == shape
        return stiffness * x

    return linear(
        energy=lambda x: 0.5 * own(x) * x,
        value=own,
        tangent=lambda x: own(np.ones_like(x)),
    )


KNOTS = np.linspace(-0.15, 0.15, 38)
SOUND = {
    "whole numbers": linear(tangent=lambda x: np.where(x > 2, 1000, 1000)),
    "softening pieces": piecewise(KNOTS, 500.0 * (-1) ** np.arange(37)),
    "steep toe": Made(
        lambda x: np.log(np.cosh(x / 1e-3)) * 1e-3,
        lambda x: np.tanh(x / 1e-3),
        lambda x: 1e3 / np.cosh(x / 1e-3) ** 2,
    ),
    "a jump": Made(np.abs, np.sign, np.zeros_like),
    "as stiff as numbers go": Linear(1e308),
    "energy at rest": linear(energy=lambda x: 1e6 + 0.5 * E * x**2),
    "single precision": linear(
        energy=lambda x: (0.5 * E * x**2).astype(np.float32),
        value=lambda x: (E * x).astype(np.float32),
    ),
    "ends at a wall": linear(
        energy=lambda x: np.where(x < 0.01, 0.5 * E * x**2, np.inf),
        value=lambda x: np.where(x < 0.01, E * x, 7.0),
    ),
    "wrong past its domain": linear(
        value=lambda x: np.where(np.abs(x) < 0.05, E * x, 0.0), domain=(-0.05, 0.05)
    ),
    "wrong past the pole": linear(
        energy=lambda x: np.where(x < 0.02, 0.5 * E * x**2, np.nan),
        value=lambda x: np.where(x < 0.02, E * x, -x),
    ),
    "not finite at rest": linear(energy=lambda x: np.full(x.shape, np.nan)),
    "in each element": in_each_element((6, 4)),
    "in each element, of any shape": linear(
        energy=lambda x: 0.5 * np.arange(6.0)[:, None] * x**2,
        value=lambda x: np.arange(6.0)[:, None] * x,
        tangent=lambda x: np.arange(6.0)[:, None] + 0 * x,
    ),
}


@pytest.mark.parametrize("law", SOUND.values(), ids=SOUND)
def test_a_consistent_law_is_accepted_for_fibres_and_for_shear(law):
    check_laws(Fabric(law, law), (6, 4))
    check_laws(Fabric((law, 1.0)), (6, 4))


WRONG = {
    "half the energy": (
        linear(energy=lambda x: 0.25 * E * x**2),
        r"warp law, energy: at ε = -?0\.\d+ the value is -?[\d.]+, but the derivative "
        r"of the energy is -?[\d.]+; value must be the derivative of energy",
    ),
    "wrong in compression alone": (
        linear(energy=lambda x: 0.5 * E * np.maximum(x, 0) ** 2),
        "warp law, energy: at ε = -0",
    ),
    "half the tangent": (
        linear(tangent=lambda x: 0.5 * E + 0 * x),
        r"warp law, tangent: at ε = -?[\d.]+ the tangent is 500, but the derivative "
        "of the value is 1000",
    ),
    "wrong within its domain": (
        linear(
            value=lambda x: np.where(np.abs(x) < 0.2, E * x, 0.0), domain=(-0.5, 0.5)
        ),
        r"warp law, value: at ε = -?0\.[2345]",
    ),
    "a scalar of numpy": (
        linear(value=lambda x: np.float64(E)),
        "warp law, value: must return an array .* argument, not float64",
    ),
    "text": (
        linear(value=lambda x: np.full(x.shape, "a")),
        "warp law, value: must return real numbers, not <U1",
    ),
    "for numbers alone": (
        linear(value=lambda x: math.sinh(x)),
        r"warp law, value: an argument of shape \(6, 4\) raised TypeError",
    ),
    "half the energy in each element": (
        linear(
            energy=lambda x: np.arange(6.0)[:, None] * x**2,
            value=lambda x: np.arange(6.0)[:, None] * x,
            tangent=lambda x: np.arange(6.0)[:, None] + 0 * x,
        ),
        "warp law, energy: at ε = ",
    ),
}


@pytest.mark.parametrize(("law", "message"), WRONG.values(), ids=WRONG)
def test_an_inconsistent_law_is_rejected_in_one_line(law, message):
    refused(lambda: check_laws(Fabric(law), (6, 4)), message)


@pytest.mark.parametrize(
    ("reach", "fabric"),
    [
        (0.1, lambda law: Fabric((law, 1.0))),
        (np.radians(80), lambda law: Fabric(1.0, law)),
    ],
    ids=["tension", "shear"],
)
def test_a_law_without_a_domain_is_checked_up_to_a_strain_or_angle(reach, fabric):
    def ending_at(end):
        law = linear(value=lambda x: np.where(np.abs(x) < end, E * x, 0.0))
        check_laws(fabric(law), (4, 4))

    ending_at(1.05 * reach)
    refused(lambda: ending_at(0.95 * reach), "law, value: at")


def test_the_cost_of_the_check_is_independent_of_the_mesh():
    calls = []

    class Counted(Linear):
        def value(self, x):
            calls.append(x.size)
            return super().value(x)

    check_laws(Fabric(Counted(1.0), Counted(1.0)), (1_000_000, 4))
    assert len(calls) == 2  # once for both families
    assert sum(calls) < 10_000
