"""Shear tests: forces and displacements of their machines, and their reduction."""

from dataclasses import astuple

import numpy as np
import pytest

from skfem_textile import Fabric, Linear, Polynomial, Sin2
from skfem_textile.calibration import BiasExtension, PictureFrame
from skfem_textile.scenes import Case, bias_extension, picture_frame, specimen
from skfem_textile.scenes.bias_extension import force
from skfem_textile.scenes.shear_test import BiasTest, FrameTest

# Measurements of shear tests from known loads


def forces(x, y):
    return np.stack([x, y], axis=1)


@pytest.mark.parametrize(("theta", "share"), [(45.0, 1.0), (40.0, 0.5)])
def test_the_law_is_recovered_from_an_exact_bias_test(theta, share):
    """Up to the error of straight lines between a hundred states."""
    theta, width, height, law = np.radians(theta), 50.0, 120.0, Sin2(0.5)
    gamma = np.linspace(0.0, np.radians(50), 101)
    pull = [share * force(law, g, width, height, theta) for g in gamma]
    L = (height / np.sin(theta) - width / np.cos(theta)) / 2
    pulled = 2 * L * (np.sin(theta + gamma / 2) - np.sin(theta))
    test = BiasTest(width, height, theta, share)
    references = forces(0 * gamma, pulled), forces(0 * gamma, np.array(pull))
    displacement, F = test.measured(*references)
    assert displacement == pytest.approx(pulled)
    assert pytest.approx(np.array(pull) / share) == F
    assert test.shear_angle(displacement) == pytest.approx(gamma, abs=1e-12)
    expected = law.value(gamma) / np.cos(gamma)
    computed = test.normalised(gamma, F)
    assert computed == pytest.approx(expected, abs=1e-4 * expected.max())


def test_a_displacement_beyond_inextensible_fibres_has_no_angle():
    """A row without force, or with a decreasing angle, has no shear force."""
    test, force = BiasTest(50.0, 100.0), np.array([0.0, 1.0, np.nan, 3.0])
    angle = test.shear_angle(np.array([0.0, 5.0, 1e3, 1e4]))
    assert np.isfinite(angle).tolist() == [True, True, False, False]
    rising = np.isfinite(test.normalised(np.array([0.0, 0.1, 0.2, 0.05]), force))
    assert rising.tolist() == [True, True, False, False]
    assert np.isnan(FrameTest(100.0, 100.0).shear_angle(np.array([1e3]))).all()


def test_the_law_is_recovered_from_a_picture_frame():
    law, test = Polynomial((0.1, 0.0, 0.3)), FrameTest(200.0, 140.0)
    scene = picture_frame("aligned", (4, 4), side=140.0, frame=200.0)
    fabric = Fabric(1e6, law, scene.warp, scene.weft)
    result = Case(scene=scene, fabric=fabric, steps=2).run()
    moved = np.array([scene.driven_displacement(s) for s in result.states])
    force = np.array([scene.reaction(s) for s in result.states])
    assert scene.shear_test == test
    displacement, F = test.measured(moved, force)
    gamma = np.linspace(0, np.pi / 4, 3)
    assert test.shear_angle(displacement) == pytest.approx(gamma, abs=1e-12)
    assert pytest.approx(test.force(law, gamma), rel=1e-6, abs=1e-9) == F
    normalised = law.value(gamma) / np.cos(gamma)
    assert test.normalised(gamma, F) == pytest.approx(normalised, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("options", "sides", "expected"),
    [
        ({"width": 80.0, "height": 240.0}, [80, 240], (80.0, 240.0, np.pi / 4, 1.0)),
        ({"part": "half", "width": 80.0}, [40, 160], (80.0, 160.0, np.pi / 4, 0.5)),
    ],
)
def test_specimens_have_the_dimensions_of_the_user(options, sides, expected):
    scene = bias_extension("aligned", **options)
    assert np.ptp(scene.mesh.p, axis=1) == pytest.approx(sides)
    assert astuple(scene.shear_test) == pytest.approx(expected)


def test_a_pulled_specimen_is_a_bias_test():
    pulled = specimen(moves=[("bottom", (0, 0)), ("top", (0, 5))])
    assert pulled.shear_test == BiasTest(50.0, 100.0)


@pytest.mark.parametrize(
    "other",
    [
        {"weft": np.pi / 2},
        {"height": 90.0},
        {"height": 100 * (1 - 1e-5)},
        {"weft": 0.75 * np.pi + 1e-5},
        {"moves": [("bottom", (0, 0)), ("top", (1, 5))]},
        {"moves": [("bottom", (0, 0)), ("top", ("free", 5))]},
        {"moves": [("bottom", ("free", 0)), ("top", (0, 5))]},
        {"moves": [("bottom", (0, 0)), ("top", (0, "free")), ("left", (0, 0))]},
        {"moves": [("bottom", (0, 0)), ("top", (0, 5)), ("left", (0, "free"))]},
    ],
)
def test_a_specimen_without_bias_geometry_is_not_a_bias_test(other):
    assert specimen(**other).shear_test is None


# Reductions of picture frame and bias extension


LAW = Polynomial((0.1, 0.0, -0.1, 0.0, 0.5))
GAMMA = np.radians(np.linspace(1.0, 40.0, 79))
BIAS = [
    BiasExtension(W, H, np.radians(degrees))
    for W, H, degrees in ((115, 230, 45), (150, 450, 45), (100, 220, 35), (80, 230, 55))
]
TESTS = [*BIAS, PictureFrame(200.0, 160.0)]


@pytest.mark.parametrize("test", TESTS, ids=str)
def test_displacement_and_shear_angle_are_inverse_functions(test):
    values = test.displacement(GAMMA)
    np.testing.assert_allclose(test.shear_angle(values), GAMMA, rtol=1e-10)
    end = test.displacement(np.array([test.largest_angle]))
    assert np.isnan(test.shear_angle(1.01 * end)).all()


@pytest.mark.parametrize("test", TESTS, ids=str)
def test_the_work_of_the_force_is_the_energy_of_the_fabric(test):
    """By quadrature of the force, for the areas that shear by γ and γ/2."""
    fine = np.linspace(0.0, GAMMA[-1], 4001)
    work = np.trapezoid(test.force(LAW, fine), test.displacement(fine))
    if isinstance(test, PictureFrame):
        areas = {1.0: test.fabric**2}
    else:
        half = test.width**2 * np.tan(test.inclination)
        areas = {1.0: test.width * test.height - 1.5 * half, 0.5: half}
    energy = sum(A * LAW.energy(np.array(s * fine[-1])) for s, A in areas.items())
    assert work == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("test", TESTS, ids=str)
@pytest.mark.parametrize("law", [LAW, Sin2(0.3)])
def test_the_law_is_recovered_by_reduction_point_by_point(test, law):
    computed = test.moment(GAMMA, test.force(law, GAMMA))
    np.testing.assert_allclose(computed, law.value(GAMMA), rtol=2e-3)


@pytest.mark.parametrize("first", [0.5, 10.0, 30.0])
def test_the_recursion_is_exact_for_a_linear_law_from_any_start(first):
    gamma = np.radians(np.array([first, 31.0, 40.0]))
    computed = BIAS[0].moment(gamma, BIAS[0].force(Linear(0.2), gamma))
    np.testing.assert_allclose(computed, 0.2 * gamma, rtol=1e-12)
