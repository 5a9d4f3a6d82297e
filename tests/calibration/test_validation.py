"""Predictions of tests that were not used in a fit."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from skfem_textile import Fabric, Linear
from skfem_textile.calibration import (
    BiasExtension,
    Choice,
    PictureFrame,
    Simulation,
    Zeros,
    fit_tests,
    load_band,
    predict,
    validate,
)
from skfem_textile.calibration.report import joint_report, validation_report
from skfem_textile.calibration.simulation import FIBRES
from skfem_textile.calibration.validation import _interpolated
from skfem_textile.cli import fit_report
from tests.helpers import fits
from tests.helpers.fits import FRAME

LAW = Linear(0.2)
STRIP = BiasExtension(60.0, 150.0)
COARSE = Simulation(across=2, steps=2)
KNOWN = Zeros(0.0, 0.0)
GAMMA = np.radians(np.linspace(2.0, 35.0, 40))


def specimen(test, noise=0.0, seed=0, scale=1.0, zeros=KNOWN):
    return fits.specimen(test, LAW, GAMMA, noise, seed, scale, zeros=zeros)


@cache
def fitted(noise=0.01, seed=0):
    return fit_tests([specimen(FRAME, noise, seed)], Choice("linear"))


def test_a_frame_is_predicted_without_a_discretisation_error():
    other = PictureFrame(300.0, 250.0)
    (found,) = validate(fitted(), Fabric(FIBRES), [specimen(other)], COARSE)
    one = found.prediction
    law = fitted().laws["shear"]
    np.testing.assert_allclose(one.force, other.force(law, GAMMA), rtol=1e-6)
    np.testing.assert_allclose(one.discretisation, 0.0, atol=1e-6)
    np.testing.assert_allclose(
        one.deviation / one.force, one.deviation[0] / one.force[0], rtol=1e-6
    )
    low, high = fitted().parts["shear"].intervals[0]
    np.testing.assert_allclose(
        2 * one.pointwise / one.force, (high - low) / law.stiffness, rtol=1e-6
    )


def test_the_slopes_of_a_bias_extension_are_those_of_simulations():
    """The band is computed without a simulation for each parameter."""
    coarse, gamma = Simulation(across=4, steps=2), np.linspace(0.0, GAMMA[-1], 3)[1:]
    strip = fits.strip(Linear(5e3), np.linspace(0.0, 6.0, 50))
    tests = [specimen(FRAME, 0.01), strip]
    result = fit_tests(tests, Choice("linear", "linear"))
    one = predict(result, Fabric(5e3), STRIP, gamma, coarse)
    warp, shear = result.fit.joint.values
    stiffer = coarse.test(
        {"warp": Linear(warp), "weft": Linear(5e3), "shear": Linear(1.02 * shear)},
        *(STRIP, float(gamma[-1])),
    )
    expected = (stiffer.forces - one.simulated.forces)[1:] / (0.02 * shear)
    np.testing.assert_allclose(one.slopes[:, 1], expected, rtol=0.03)


def validated(seed, zeros, scale=1.0, test=FRAME):
    held_out = specimen(test, 0.02, 100 + seed, scale, zeros)
    (one,) = validate(fitted(0.02, seed), Fabric(FIBRES), [held_out], COARSE)
    return one


@pytest.mark.parametrize(
    ("test", "zeros"), [(STRIP, KNOWN), (FRAME, KNOWN), (FRAME, Zeros(None, None))]
)
def test_the_known_law_is_confirmed_and_one_that_is_far_off_is_not(test, zeros):
    right, wrong = (validated(0, zeros, scale, test) for scale in (1.0, 1.4))
    assert right.confirmed
    assert 0.85 < right.share() <= 1.0
    assert right.noise == pytest.approx(0.02 * right.measured.max(), rel=0.3)
    assert not wrong.confirmed
    assert wrong.share() < right.share()


@pytest.mark.slow
@pytest.mark.parametrize("zeros", [KNOWN, Zeros(None, None)])
def test_the_known_law_is_confirmed_in_95_of_100_tests(zeros):
    right = [validated(seed, zeros) for seed in range(20)]
    assert sum(one.confirmed for one in right) >= 18
    assert 0.92 < np.mean([one.share() for one in right]) < 0.99
    assert not any(validated(seed, zeros, scale=1.4).confirmed for seed in range(5))


def test_specimens_that_differ_widen_the_band_of_a_further_one():
    several = [specimen(FRAME, 0.01, i, scale) for i, scale in enumerate((0.9, 1, 1.1))]
    result = fit_tests(several, Choice("linear"))
    (found,) = validate(result, Fabric(FIBRES), [specimen(FRAME)], COARSE)
    assert np.all(found.scatter > found.prediction.pointwise)
    (same,) = validate(fitted(), Fabric(FIBRES), [specimen(FRAME)], COARSE)
    assert not same.scatter.any()


def test_the_band_of_a_user_defined_load_is_that_of_a_prediction():
    """The same problem: a frame of shear moment alone, without a simulation."""
    result = fitted(0.03)
    other = PictureFrame(300.0, 250.0)
    calls = []

    def loads(fabric):
        calls.append(fabric)
        return other.force(fabric.shear, GAMMA)

    band = load_band(result, Fabric(FIBRES), loads)
    one = predict(result, Fabric(FIBRES), other, GAMMA, COARSE)
    np.testing.assert_allclose(band.force, one.force, rtol=1e-6)
    np.testing.assert_allclose(band.pointwise, one.pointwise, rtol=1e-5)
    assert band.simultaneous == pytest.approx(one.simultaneous)
    assert band.slopes.shape == (GAMMA.size, 1)
    assert len(calls) == 3


def test_the_band_of_a_load_includes_the_possible_zeros():
    """It is nowhere more than 10 % narrower than the band of the mixture.

    The band of the most probable zeros alone is up to 66 % narrower.
    """
    ratios = []
    for seed in range(3):
        one = specimen(FRAME, 0.05, seed)
        force = one.force + 0.04 * one.force.max()
        loose = replace(one, force=force, zeros=Zeros(0.0, None))
        result = fit_tests([loose], Choice("polynomial", degree=3))
        fit = result.parts["shear"]
        correlations = np.array(joint_report(result)["correlations"])
        np.testing.assert_allclose(np.diag(correlations), 1.0)

        def value(law):
            return law.value(GAMMA[5:])

        band = load_band(result, Fabric(FIBRES), lambda fabric: value(fabric.shear))
        likely = max(weight for weight, _ in fit.alternatives)
        if likely < 0.95:
            ratios.append(2 * band.pointwise / np.ptp(fit.band(value), axis=0))
    assert len(ratios) > 1
    assert np.min(ratios) > 0.9
    assert np.max(ratios) < 2.0


def test_a_report_says_how_far_a_prediction_is_off_and_where_it_is_inside():
    found = validate(fitted(), Fabric(FIBRES), [specimen(FRAME, scale=1.4)], COARSE)
    report = validation_report(found)
    (row,), one = report["rows"], found[0]
    off = 1 - one.prediction.force[-1] / (1.4 * FRAME.force(LAW, GAMMA[-1]))
    assert row["largest_over_largest_force"] == pytest.approx(off)
    assert row["largest_N"] == pytest.approx(off * one.measured.max())
    assert 0.2 < off < 0.4
    assert row["rms_N"] == pytest.approx(np.sqrt(np.mean(one.difference**2)))
    assert row["parameters_N"] == one.prediction.pointwise.max()
    (lines,) = fit_report._validation(report).values()
    said = {line[0]: line[-1] for line in lines}
    assert f" N, {100 * off:.1f} % of the largest" in said["Largest difference"]
    assert said["Inside the band of a point"] == "0 %"
    assert said["Largest shear angle"] == "35.0°"


@pytest.mark.parametrize(("missing", "is_known"), [(2, True), (3, False)])
def test_half_widths_of_most_states_are_interpolated(missing, is_known):
    half = np.append(np.ones(5 - missing), np.full(missing, np.nan))
    found = SimpleNamespace(half_widths=half, angles=np.arange(5.0))
    assert np.isfinite(_interpolated(found, np.array([0.5]))).all() == is_known
