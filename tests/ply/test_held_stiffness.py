"""Rules for the stiffnesses of stabilisation, deviations and fibres."""

import numpy as np
import pytest

from skfem_textile import Polynomial, Tabulated
from skfem_textile.fabric.law import mean_slope
from skfem_textile.ply.parameters import (
    deviation_stiffness,
    shear_stiffness,
    stabilisation_stiffness,
)


@pytest.mark.parametrize(
    ("G", "E", "T", "resistance"),
    [
        (0.5, 1e6, 0.0, 0.5),
        (0.5, 1e2, 0.0, 0.5),
        (0.5, 1e6, 3.0, 0.5 + 0.7 * 3.0 / (1 + 80 * np.sqrt(5e-7))),
        (0.5, 1e6, -3.0, 0.5 + 0.7 * 3.0 / (1 + 80 * np.sqrt(5e-7))),
        (0.5, 1e2, 3.0, 0.5 + 0.7 * 3.0 / (1 + 80 * np.sqrt(5e-3))),
    ],
)
def test_deviations_have_shear_and_tension_in_series_with_fibres(G, E, T, resistance):
    E_d = deviation_stiffness(1000.0, *map(np.array, (G, E, T)))
    assert 1 / E_d == pytest.approx(1 / (1000 * resistance) + 1 / E, rel=1e-12)


def test_stiffnesses_are_shares_of_the_fibres_without_shear_stiffness():
    """At any tension and angle."""
    G, T = np.array(0.0), np.array(3.0)
    assert stabilisation_stiffness(G, np.array(1e4), T, np.array(0.5)) == 1.0
    little = stabilisation_stiffness(G + 1e-10, np.array(1e4), 0 * T, np.array(0.5))
    assert little == pytest.approx(np.exp(-1))
    assert deviation_stiffness(1000.0, G, np.array(1e4), T) == 5e3
    assert deviation_stiffness(1000.0, G, np.array(0.0), T) == 0.0


@pytest.mark.parametrize(
    "rule",
    [
        lambda G, E: stabilisation_stiffness(G, E, 0.0 * G, 0.0 * G),
        lambda G, E: deviation_stiffness(1000.0, G, E, 0.0 * G),
    ],
)
def test_stiffnesses_are_continuous_at_zero_shear_stiffness(rule):
    """Their increment from one G to the next decreases with the increment of G."""
    E = np.array(1e5)
    G = np.append(0.0, np.geomspace(1e-12, 1.0, 4001))
    steps = np.abs(np.diff(rule(G, E)))
    fewer = np.abs(np.diff(rule(G[::2], E)))
    assert steps.max() < 0.6 * fewer.max()
    assert rule(G, E).min() > 0


def test_the_stiffness_of_shear_is_its_secant_at_any_small_angle():
    law = Polynomial((1.0, 0.0, 1e10))
    secants = shear_stiffness(law, np.array([0.0, 1e-5, -2e-5]))
    np.testing.assert_allclose(secants, [1.0, 2.0, 5.0], rtol=1e-9)
    steep = Polynomial((1.0, 0.0, 1e12))
    assert shear_stiffness(steep, np.array([3e-7, 3e-6])) == pytest.approx([1, 10])
    softening = Polynomial((1.0, 0.0, -1e10))
    assert shear_stiffness(softening, np.array(2e-5)) == pytest.approx(0.1)


def test_the_stiffness_of_fibres_averages_both_sides_of_a_toe():
    """A single tangent at rest would be the tangent of the soft side."""

    class Toe:
        def value(self, x):
            return np.where(x > 0, 1e5, 10.0) * x

        def tangent(self, x):
            return np.where(x > 0, 1e5, 10.0)

    slopes = mean_slope(Toe(), np.array([-0.05, 0.0, 0.05]))
    np.testing.assert_allclose(slopes, [50005.0, 50005.0, 1e5])


def test_the_stiffness_of_fibres_beyond_a_table_is_its_end_value():
    """The strain at a point may be there though the element mean is not."""
    law = Tabulated([-0.1, 0.0, 0.03], [-1.0, 0.0, 3e3])
    ends = mean_slope(law, np.array([0.03, 0.031, 0.05, 1.0]))
    assert np.isfinite(ends).all()
    np.testing.assert_array_equal(ends, ends[0])
