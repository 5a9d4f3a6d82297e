"""Checks of the beginning of curves of tests."""

import re

import numpy as np
import pytest

from skfem_textile import CrimpToe, Linear, Polynomial, Sin2
from skfem_textile.calibration import BiaxialCurve, Specimen
from skfem_textile.calibration.curves import force_at_rest, seems_swapped
from skfem_textile.calibration.report import tension_report
from tests.helpers.fits import BIAS, FRAME, fit_shear, fit_tension, noisy
from tests.helpers.fits import notes as notes_of

SOFTENING = Polynomial((0.3, 0.0, -0.3, 0.0, 0.6))


def curve(test, law, n=60, seed=0, noise=0.0):
    """Equal steps of the displacement to 39 degrees: displacement, angle, force."""
    end = float(test.displacement(np.radians(39.0)))
    moved = np.linspace(0.0, end, n + 1)[seed % 2 :]
    angle = test.shear_angle(moved)
    return moved, angle, noisy(test.force(law, angle), noise, seed)


def notes(moved, force, test=BIAS):
    """Notes of the report, or of the refusal of a law that is not physical."""
    try:
        return notes_of(fit_shear([Specimen("one", test, force, moved)]))
    except ValueError as refusal:
        return str(refusal)


@pytest.mark.parametrize("n", [20, 60, 300])
@pytest.mark.parametrize(
    ("test", "law"),
    [(BIAS, Linear(0.1)), (FRAME, SOFTENING), (BIAS, Polynomial((0, 0, 0.5)))],
)
def test_noise_is_not_taken_for_a_force_at_rest_or_swapped_columns(test, law, n):
    for noise in (0.0, 0.02, 0.05):
        for seed in range(20):
            moved, angle, force = curve(test, law, n, seed, noise)
            assert force_at_rest(angle, force) == 0
            assert not seems_swapped(moved, force)


def test_noise_of_a_crimped_fabric_is_not_taken_for_a_force_at_rest():
    strain = np.linspace(0.0, 0.02, 40)
    force = 100.0 * CrimpToe(1e4, 0.004, 10.0).value(strain)
    for seed in range(20):
        assert force_at_rest(strain, noisy(force, 0.02, seed)) == 0


def test_a_force_at_rest_is_reported_with_its_size():
    moved, angle, force = curve(BIAS, SOFTENING)
    offset = 0.1 * force.max()
    disturbed = (noisy(force, 0.02, seed) + offset for seed in range(40))
    offsets = [force_at_rest(angle, force) for force in disturbed]
    assert min(offsets) > 0
    assert np.median(offsets) == pytest.approx(offset, rel=0.1)
    assert force_at_rest(angle, force - offset) == pytest.approx(-offset, rel=0.1)
    said = r"one: the force at rest is about (.*) N, 9 % of the largest force, and no"
    (size,) = re.findall(said, notes(moved, force + offset))
    assert float(size) == pytest.approx(offset, rel=0.1)
    assert "at rest" not in notes(moved, force)


@pytest.mark.parametrize(("n", "over"), [(120, 6), (120, 12), (300, 4), (300, 30)])
def test_a_force_that_rises_steeply_from_rest_is_not_reported(n, over):
    moved, angle, force = curve(BIAS, SOFTENING, n)
    steep = force + 0.3 * force.max() * np.tanh(moved / moved[over])
    assert force_at_rest(angle, steep) == 0


def test_no_force_at_rest_is_reported_for_a_late_or_short_curve():
    _, angle, force = curve(BIAS, SOFTENING)
    late = slice(10, None)
    assert force_at_rest(angle[late], force[late] + 10) == 0
    few = slice(None, None, 12)
    assert force_at_rest(angle[few], force[few] + 10) == 0


def test_displacements_that_do_not_start_at_zero_are_reported():
    moved, angle, force = curve(BIAS, SOFTENING, seed=0)
    assert "begins far from rest" in notes(moved + 15.0, force)
    late = angle > np.radians(12)  # and with a force
    assert "begins far from rest" not in notes(moved[late], force[late])


def test_strains_in_another_unit_are_reported():
    strain = np.log1p(np.tile(np.linspace(0.05, 2.0, 40), (2, 1)))
    pull = BiaxialCurve("pull", strain, 1e3 * strain, (100.0, 100.0))
    warnings = tension_report(fit_tension([pull], "linear"), "warp")["notes"]
    assert "pull, warp: strains reach 200 %: check their unit" in warnings


def test_angles_that_are_too_small_for_a_shear_test_are_reported():
    gamma = np.radians(np.linspace(0.1, 4.0, 30))
    small, large = (
        notes(BIAS.displacement(x), BIAS.force(Sin2(0.3), x))
        for x in (gamma, 2 * gamma)
    )
    assert "one: the shear angle reaches only 4 degrees" in small
    assert "reaches only" not in large


def test_forces_in_equal_steps_are_reported():
    moved, _, force = curve(BIAS, SOFTENING)
    scale = moved[-1] / force[-1]
    swapped = notes(force * scale, moved / scale)
    assert "check whether the columns are swapped" in swapped


def test_a_curve_of_unloading_alone_is_reported():
    moved, _, force = curve(BIAS, SOFTENING)
    warnings = notes(moved[::-1], force[::-1])
    assert "the displacement only decreases" in warnings
    assert "loading and unloading" not in warnings


@pytest.mark.parametrize(("n", "swapped"), [(8, False), (9, True)])
def test_equal_steps_of_a_short_curve_are_by_chance(n, swapped):
    steps = np.arange(float(n))
    assert seems_swapped(steps**3, steps) == swapped
