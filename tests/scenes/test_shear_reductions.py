"""Reductions of picture frame and bias extension."""

import numpy as np
import pytest

from skfem_textile import Linear, Polynomial, Sin2
from skfem_textile.calibration import BiasExtension, PictureFrame
from skfem_textile.scenes.bias_extension import force

LAW = Polynomial((0.1, 0.0, -0.1, 0.0, 0.5))
GAMMA = np.radians(np.linspace(1.0, 40.0, 79))
BIAS = [
    BiasExtension(W, H, np.radians(degrees))
    for W, H, degrees in ((115, 230, 45), (150, 450, 45), (100, 220, 35), (80, 230, 55))
]
TESTS = [*BIAS, PictureFrame(200.0, 160.0)]


@pytest.mark.parametrize("test", TESTS, ids=str)
def test_displacement_and_shear_angle_are_inverse(test):
    there = test.displacement(GAMMA)
    np.testing.assert_allclose(test.shear_angle(there), GAMMA, rtol=1e-10)
    end = test.displacement(np.array([test.largest_angle]))
    assert np.isnan(test.shear_angle(1.01 * end)).all()


@pytest.mark.parametrize("test", TESTS, ids=str)
def test_the_work_of_the_force_is_the_energy_of_the_fabric(test):
    """By quadrature of the force, beside the areas that shear by γ and γ/2."""
    fine = np.linspace(0.0, GAMMA[-1], 4001)
    work = np.trapezoid(test.force(LAW, fine), test.displacement(fine))
    if isinstance(test, PictureFrame):
        areas = {1.0: test.fabric**2}
    else:
        half = test.width**2 * np.tan(test.inclination)
        areas = {1.0: test.width * test.height - 1.5 * half, 0.5: half}
    energy = sum(A * LAW.energy(np.array(s * fine[-1])) for s, A in areas.items())
    assert work == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("test", BIAS, ids=str)
def test_the_force_of_a_bias_extension_is_that_of_the_scene(test):
    sides = test.width, test.height, test.inclination
    there = [force(LAW, gamma, *sides) for gamma in GAMMA]
    np.testing.assert_allclose(test.force(LAW, GAMMA), there, rtol=1e-12)


@pytest.mark.parametrize("test", TESTS, ids=str)
@pytest.mark.parametrize("law", [LAW, Sin2(0.3)])
def test_the_reduction_point_by_point_gives_the_law_back(test, law):
    found = test.moment(GAMMA, test.force(law, GAMMA))
    np.testing.assert_allclose(found, law.value(GAMMA), rtol=2e-3)


@pytest.mark.parametrize("first", [0.5, 10.0, 30.0])
def test_of_a_linear_law_the_recursion_is_exact_wherever_it_begins(first):
    gamma = np.radians(np.array([first, 31.0, 40.0]))
    found = BIAS[0].moment(gamma, BIAS[0].force(Linear(0.2), gamma))
    np.testing.assert_allclose(found, 0.2 * gamma, rtol=1e-12)


def test_the_frame_reduces_as_cao_et_al():
    """F_n = F_s L_frame/L_fabric² and C = F_n cos γ, by hand at 30 degrees."""
    F_s = 50.0 / (2 * np.cos(np.radians(30.0)))
    expected = F_s * 200.0 / 160.0**2 * np.cos(np.radians(30.0))
    found = PictureFrame(200.0, 160.0).moment(np.radians([30.0]), np.array([50.0]))
    assert found[0] == pytest.approx(expected, rel=1e-12)


def test_specimens_that_cannot_be_are_refused():
    for make, said in (
        (lambda: PictureFrame(100.0, 120.0), "longer than that of the frame"),
        (lambda: PictureFrame(0.0, 1.0), "side of the frame must be"),
        (lambda: BiasExtension(50.0, 90.0), "must be at least 100 mm high"),
        (
            lambda: BiasExtension(50.0, 900.0, np.pi / 2),
            "degrees, got 90",
        ),
        (lambda: BiasExtension(50.0, 900.0, np.radians(-45)), "degrees, got -45"),
        (lambda: BiasExtension(50.0, 900.0, np.nan), "degrees, got nan"),
        (lambda: BiasExtension(np.nan, 90.0), "width must be"),
    ):
        with pytest.raises(ValueError, match=said):
            make()
