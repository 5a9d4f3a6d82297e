"""Branches, outliers and origin of recordings; zeros of machines in a fit."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import Locking, Polynomial, Sin2
from skfem_textile.calibration import (
    Preparation,
    Recording,
    Specimen,
    Zeros,
    prepare,
)
from skfem_textile.calibration.outliers import outliers, overloads, wild
from skfem_textile.calibration.reading.motion import _ticks
from skfem_textile.calibration.reading.recording import rows_text
from skfem_textile.calibration.report import data_report
from skfem_textile.calibration.specimens import BELIEVED
from tests.helpers.fits import BIAS, FRAME, UNKNOWN, fit_shear, noisy, of_shear, pulled

LAW = Polynomial((0.3, 0.0, -0.3, 0.0, 0.6))
MOVED = np.linspace(0.0, float(BIAS.displacement(np.radians(39.0))), 100)
FORCE = BIAS.force(LAW, BIAS.shear_angle(MOVED))


def prepared(moved, force, **choices):
    columns = {"displacement": np.asarray(moved), "force": np.asarray(force)}
    rows = np.arange(2, 2 + len(moved))
    recording = Recording("one", columns, rows, ())
    return prepare(recording, "displacement", ["force"], Preparation(**choices))


def said(result):
    return " | ".join(result.recording.statements)


# Branches


def test_the_loading_of_a_loop_is_used_and_the_other_branch_is_stated():
    moved = np.concatenate([MOVED, MOVED[::-1]])
    force = np.concatenate([FORCE, 0.75 * FORCE[::-1]])
    one = prepared(moved, force)
    np.testing.assert_array_equal(one.recording.columns["force"], FORCE)
    assert "unloading is left out, on average 25 % below it" in said(one)
    back = prepared(moved, force, branch="unloading").recording
    assert back.columns["force"][10] == pytest.approx(0.75 * FORCE[-10], rel=0.05)
    assert prepared(moved, force, branch="both").recording.rows.size == 200
    assert [b.kind for b in one.branches] == ["loading", "unloading"]


def test_the_first_complete_cycle_is_used():
    half = MOVED[:50]
    moved = np.concatenate([half, half[::-1], MOVED, MOVED[::-1]])
    force = np.interp(moved, MOVED, FORCE)
    assert "loading of cycle 2 of 2 is used" in said(prepared(moved, force))
    first = prepared(moved, force, cycle=1).recording.columns["displacement"]
    assert first.max() <= half[-1]
    back = prepared(moved, force, branch="unloading")
    assert "unloading of cycle 2 of 2 is used" in said(back)
    assert back.recording.columns["displacement"].max() > half[-1]
    ended = prepared(moved[:-100], force[:-100], branch="unloading", cycle=1)
    assert ended.recording.rows.size > 40


def test_a_dwell_at_the_end_is_left_out():
    rest = np.full(60, MOVED[-1])
    force = np.concatenate([FORCE, FORCE[-1] * np.linspace(0.9, 0.7, 60)])
    one = prepared(np.concatenate([MOVED, rest, MOVED[::-1]]), np.append(force, FORCE))
    assert one.recording.columns["force"].size in range(98, 102)


def test_noise_of_the_displacement_is_no_reversal():
    assert len(prepared(noisy(MOVED, 0.02, 1), FORCE).branches) == 1


# Outliers


def test_outliers_are_left_out_of_each_branch():
    moved = np.concatenate([MOVED, MOVED[::-1]])
    force = noisy(np.concatenate([FORCE, 0.75 * FORCE[::-1]]), 0.01, 2)
    force[[20, 150]] = 99999.0, -9999.0
    one = prepared(moved, force, branch="both")
    assert one.outliers.tolist() == [22, 152]
    assert "rows 22, 152: outliers of the force, such as 99999" in said(one)
    assert one.recording.rows.size == 198
    force[100] = 99999.0  # next to the turn
    assert prepared(moved, force, branch="both").outliers.tolist() == [22, 102, 152]


@pytest.mark.slow
def test_normal_noise_has_no_outliers():
    """At most one in a thousand curves, by definition; of 300, five is improbable."""
    noises = (noisy(FORCE, 0.03, seed) for seed in range(300))
    assert sum(outliers(MOVED, force).any() for force in noises) < 5


def test_a_kink_or_a_steep_end_is_no_outlier():
    slack = np.maximum(MOVED - 8.0, 0.0)
    assert not outliers(MOVED, slack).any()
    assert not outliers(MOVED, np.tan(1.5 * MOVED / MOVED[-1])).any()
    assert not outliers(MOVED, np.where(MOVED > 20.0, 0.3 * FORCE, FORCE)).any()


@pytest.mark.parametrize("value", [99999.0, -9999.0, 0.3 * FORCE.max() + 30.0])
def test_outliers_are_named_by_row_and_left_out(value):
    force = noisy(FORCE, 0.01, 2)
    force[[20, 21, 70]] = value, 1.1 * value, value
    one = prepared(MOVED, force)
    assert one.outliers.tolist() == [22, 23, 72]
    assert "rows 22, 23, 72: outliers of the force, such as" in said(one)
    assert one.recording.rows.size == 97
    kept = prepared(MOVED, force, outliers=False)
    assert kept.outliers.size == 0
    assert kept.recording.rows.size == 100


def test_jumps_of_the_displacement_are_named():
    one = prepared(np.where(np.arange(100) == 40, -500.0, MOVED), FORCE)
    assert one.outliers.tolist() == [42]
    assert "row 42: outliers of the displacement, such as -500" in said(one)


# Zeros


def test_an_absolute_position_is_counted_from_its_beginning():
    one = prepared(MOVED + 134.5, FORCE)
    assert one.origin == pytest.approx(134.5)
    assert "displacements are counted from 134.5 mm, at row 2" in said(one)
    late = prepared(MOVED[40:], FORCE[40:])
    assert late.origin == 0.0
    assert not late.begins_at_rest


def specimen(toe=0.0, at_rest=0.0, noise=0.01, seed=1, zeros=UNKNOWN):
    """Curve of `LAW` with a toe in mm and a share of the largest force at rest."""
    moved = np.linspace(0.0, MOVED[-1] + toe, 200)
    one = pulled(BIAS, LAW, moved, toe, noise, seed, zeros)
    return replace(one, force=one.force + at_rest * FORCE.max())


def test_a_toe_is_determined_with_its_uncertainty_and_reported():
    gamma = np.radians([10.0, 20.0, 30.0])
    fit = fit_shear([specimen(toe=2.0)])
    slack, low, high = fit.parts["shear"].zeros(0)["slack"]
    assert low < 2.0 < high
    assert slack == pytest.approx(2.0, abs=0.5)
    np.testing.assert_allclose(
        fit.laws["shear"].value(gamma), LAW.value(gamma), rtol=0.06
    )
    ignored = fit_shear([specimen(toe=2.0, zeros=Zeros())])
    assert ignored.laws["shear"].value(gamma[0]) < 0.9 * LAW.value(gamma[0])
    (data,) = data_report(fit)
    assert data["prepared"][0].startswith("a slack of 2")
    given = fit_shear([specimen(toe=2.0, zeros=Zeros(2.0, 0.0))])
    np.testing.assert_allclose(
        given.laws["shear"].value(gamma), LAW.value(gamma), rtol=0.03
    )


def test_the_force_at_rest_is_fitted_where_the_data_show_it():
    fit = of_shear([specimen(toe=3.0, at_rest=0.15)])
    assert fit.free == {"slack", "force at rest"}
    _, low, high = fit.zeros(0)["force at rest"]
    assert low < 0.15 * BIAS.force(LAW, np.radians(39.0)) < high
    assert of_shear([specimen(toe=3.0)]).free == {"slack"}


@pytest.mark.slow
@pytest.mark.parametrize("toe", [0.0, 2.0])
def test_bands_contain_the_law_at_the_stated_rate_with_unknown_zeros(toe):
    """The rate is 95 %: of 25 seeds, three standard deviations are 3.3 seeds."""
    gamma, inside = np.radians([5.0, 15.0, 30.0, 38.0]), []

    def value(law):
        return law.value(gamma)

    for seed in range(25):
        low, high = of_shear([specimen(toe, seed=seed)]).band(value)
        inside.append((low <= value(LAW)) & (value(LAW) <= high))
    assert np.all(np.mean(inside, axis=0) >= 0.8)


@pytest.mark.parametrize("at_rest", [0.0, 0.15])
def test_the_band_of_a_curve_is_that_of_its_noise_whatever_its_zeros(at_rest):
    """Zeros and laws that differ together predict the same curve."""
    one, exact = (specimen(2.0, at_rest, noise) for noise in (0.01, 0.0))
    result = fit_shear([one])
    fit, used = result.parts["shear"], result.specimens[0].used(None)
    low, high = fit.curve_band(0)
    known = exact.force[used]
    assert np.mean((low <= known) & (known <= high)) > 0.8
    assert (high - low).max() < 2 * fit.noise[0]


def test_a_slack_that_is_not_rejected_is_0_in_the_law_and_free_in_its_band():
    known = of_shear([specimen(zeros=Zeros())])
    unknown = of_shear([specimen(zeros=Zeros(None, 0.0))])
    assert unknown.free == frozenset()
    np.testing.assert_allclose(unknown.values, known.values, rtol=1e-6)
    ((_, free),) = unknown.alternatives
    assert free.jacobian.shape == (200, 4)
    np.testing.assert_array_equal(unknown.intervals, free.intervals)
    assert np.all(np.ptp(unknown.intervals, axis=1) > 1.2 * np.ptp(known.intervals, 1))


def correlated(rng, n, rho):
    """Noise of unit variance, with this correlation of neighbours."""
    e = rng.standard_normal(n)
    for i in range(1, n):
        e[i] = rho * e[i - 1] + np.sqrt(1 - rho**2) * e[i]
    return e


def test_no_slack_is_invented_on_noisy_frames_that_begin_at_the_origin():
    """An F-test at 5 % rejects zero in 1 of 20 by chance; 4 of 8 are improbable."""
    moved = np.linspace(0.0, float(FRAME.displacement(np.radians(44.0))), 150)
    exact, invented = pulled(FRAME, Sin2(0.1), moved, zeros=Zeros(None, 0.0)), 0
    for seed in range(8):
        noise = correlated(np.random.default_rng(seed), 150, 0.8)
        force = exact.force + 0.05 * exact.force.max() * noise
        fit = of_shear([replace(exact, force=force)], "sin2")
        invented += "slack" in fit.free
        ((low, high),) = fit.intervals
        assert low <= fit.values[0] <= high
    assert invented < 4


def test_repeats_have_a_toe_each():
    toes = 0.5, 2.0, 3.5
    repeats = [specimen(toe, seed=i) for i, toe in enumerate(toes)]
    fit = of_shear(repeats)
    for i, toe in enumerate(toes):
        _, low, high = fit.zeros(i)["slack"]
        assert low < toe < high
    assert not fit.beyond_noise


def test_a_measured_angle_determines_the_slack():
    gamma = np.radians(np.linspace(0.0, 39.0, 50))
    moved = BIAS.displacement(gamma) + 3.0
    one = Specimen("one", BIAS, BIAS.force(LAW, gamma), moved, gamma, UNKNOWN)
    assert one.slack == pytest.approx(3.0)
    assert np.degrees(one.kinematics_limit) == pytest.approx(39.0)


LAWS = {"tabulated": LAW, "locking": Locking(0.2, np.radians(70)), "sin2": Sin2(0.2)}


@pytest.mark.parametrize(("name", "law"), LAWS.items())
def test_every_law_is_fitted_with_a_toe(name, law):
    one = pulled(FRAME, law, np.linspace(0.0, 60.0, 21), 3.0)
    fit = of_shear([one], name, points=3)
    gamma = np.radians([10.0, 20.0])
    np.testing.assert_allclose(fit.law.value(gamma), law.value(gamma), rtol=0.03)


def test_a_slack_does_not_close_a_frame():
    """A negative slack would continue the motion beyond a right angle."""
    moved = np.linspace(0.0, float(FRAME.displacement(np.radians(84.0))), 200)
    one = pulled(FRAME, LAW, moved)
    sample = of_shear([one]).samples[0]
    _, slack = sample.offsets
    for law in (LAW, Locking(0.1, np.radians(80.0))):
        assert np.isfinite(sample.predict({"shear": law}, 0.0, slack.low)).all()
    assert one.last_angle(np.inf) == pytest.approx(0.999 * np.pi / 2)


def test_rows_after_a_break_are_stated_and_left_out():
    force = np.append(FORCE, np.full(9, 0.02 * FORCE.max()))
    moved = np.append(MOVED, MOVED[-1] + np.arange(1, 10) * 0.1)
    found = prepared(moved, force)
    assert found.recording.rows.size == FORCE.size
    assert "rows 102, 103, 104, 105, 106 and 4 more: the force is less" in said(found)
    assert prepared(moved, force, outliers=False).recording.rows.size == force.size
    fallen = np.append(FORCE, np.full(9, 0.7 * FORCE.max()))  # as by slip
    assert prepared(moved, fallen).recording.rows.size == force.size


def test_the_end_of_a_curve_that_rises_steeply_is_not_an_overload():
    assert not overloads(10.0 ** np.arange(8)).any()
    assert not overloads(np.zeros(9)).any()
    assert overloads(np.array([0.0, 0.0, 5.0, 0.0])).tolist() == [0, 0, 1, 0]


def noisy_toe(seed, toe=8.0):
    """Curve beyond the range, of 45 degrees, with much noise and a long toe."""
    moved = np.linspace(0.0, float(BIAS.displacement(np.radians(45.0))) + toe, 120)
    return pulled(BIAS, LAW, moved, toe, 0.05, seed, Zeros(None, 0.0))


def test_the_range_ends_at_the_angle_of_the_fitted_slack():
    step = np.radians(1.5)  # of two points, between which a range may alternate
    for seed in range(3):
        fit = fit_shear([noisy_toe(seed)])
        (one,) = fit.specimens
        (slack, *_) = fit.parts["shear"].zeros(0)["slack"]
        angle = BIAS.shear_angle(np.maximum(one.displacement - slack, 0.0))
        assert abs(angle[one.used(None)].max() - BELIEVED) < step
        assert fit.largest_angle == pytest.approx(angle[one.used(None)].max())
        (data,) = data_report(fit)
        assert f"angle of {np.degrees(fit.largest_angle):.1f}°" in data["prepared"][-1]


def test_a_range_is_found_from_any_assumed_slack_near_it():
    one = noisy_toe(0)
    found = [
        fit_shear([replace(one, assumed_slack=slack)]).parts["shear"].zeros(0)["slack"]
        for slack in (6.0, 10.0)
    ]
    np.testing.assert_allclose(found[1:], found[:1], rtol=1e-4)


@pytest.mark.parametrize(
    ("n", "off", "number"),
    [(11, 9.0, 0), (12, 9.0, 1), (2000, 3e-3, 0), (2000, 0.03, 1)],
)
def test_an_outlier_is_one_of_twelve_rows_and_a_hundredth_of_the_range(n, off, number):
    force = np.linspace(0.0, 1.0, n)
    force[n // 2] += off
    assert outliers(np.arange(n), force).sum() == number


def test_a_wild_reading_is_half_of_the_median_off():
    assert wild(np.array(9 * [1.0] + [1.3, 1.8])).tolist() == 10 * [False] + [True]


def test_five_rows_are_listed_and_a_pause_is_three_steps():
    assert rows_text(range(1, 6)) == "rows 1, 2, 3, 4, 5"
    assert rows_text(range(1, 8)) == "rows 1, 2, 3, 4, 5 and 2 more"
    assert [_ticks(np.arange(3), np.arange(3) + 2 + x) for x in (2, 4)] == [True, False]
