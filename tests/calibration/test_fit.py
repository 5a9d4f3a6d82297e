"""Shear laws from curves of specimens."""

import numpy as np
import pytest
from scipy.stats import t as student

from skfem_textile import Linear, Locking, Sin2, Tabulated
from skfem_textile.calibration import BiasExtension, Simulation, Specimen
from skfem_textile.calibration.models import crimp_toe, tabulated
from skfem_textile.calibration.report import data_report, shear_report
from tests.helpers import fits
from tests.helpers.fits import BIAS, FRAME, QUINTIC, fit_shear, notes, of_shear

LAWS = {
    "linear": Linear(0.2),
    "sin2": Sin2(0.2),
    "polynomial": QUINTIC,
    "locking": Locking(0.1, np.radians(60.0)),
    "tabulated": Tabulated(np.radians(5 * np.arange(9)), np.arange(9.0) ** 2, odd=True),
}
NARROW = BiasExtension(50.0, 100.0)
COARSE = Simulation(across=2, steps=1)


def specimen(test, law, noise=0.0, seed=0, n=60, end=40.0, scale=1.0):
    """A specimen of a law up to an angle in degrees."""
    gamma = np.linspace(0.0, np.radians(end), n + 1)[1:]
    return fits.specimen(test, law, gamma, noise, seed, scale)


@pytest.mark.parametrize("test", [BIAS, FRAME], ids=["bias", "frame"])
@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_recovered_from_data_without_noise(test, name):
    gamma, law = np.radians(np.linspace(1.0, 39.9, 50)), LAWS[name]
    recovered = of_shear([specimen(test, law)], name).law
    assert type(recovered) is type(law)
    np.testing.assert_allclose(recovered.value(gamma), law.value(gamma), rtol=1e-5)


@pytest.mark.slow
def test_coefficients_are_within_their_bands_at_the_stated_rate():
    """The rate is 95 %: 90 to 99 % of 200 seeds, about three standard deviations."""
    inside = []
    for seed in range(200):
        three = [specimen(FRAME, QUINTIC, 0.02, (seed, i)) for i in range(3)]
        low, high = of_shear(three).intervals.T
        truth = np.array(QUINTIC.coefficients[::2])
        inside.append((low <= truth) & (truth <= high))
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.945) < 0.045)


def test_the_band_accounts_for_estimated_weights():
    """The covariance is (JᵀWJ)⁻¹ (1 + 4 Σ s (1 − s)/ν), s = 1/3, ν = 59.

    The band has the quantile of Student's t for 179 degrees of freedom.
    """
    three = [specimen(FRAME, Linear(0.1), 0.02, i) for i in range(3)]
    fit = of_shear(three, "linear")
    J, weights = fit.jacobian[:60, 0], fit.noise**-2
    share = weights / weights.sum()
    more = 4 * np.sum(share * (1 - share) / (60 - share))
    expected = (1 + more) / (J @ J * weights.sum())
    assert fit.covariance[0, 0] == pytest.approx(expected, rel=1e-9)
    half = student.ppf(0.975, 179) * np.sqrt(expected)
    assert fit.intervals[0] == pytest.approx(np.add(fit.values, [-half, half]))


def test_the_noise_of_each_specimen_is_reported_and_determines_its_weight():
    noises = (0.01, 0.02, 0.05)
    several = [specimen(BIAS, QUINTIC, x, i, n=400) for i, x in enumerate(noises)]
    computed = of_shear(several).noise / BIAS.force(QUINTIC, np.radians(40.0))
    np.testing.assert_allclose(computed, noises, rtol=0.15)
    tiny = of_shear([specimen(FRAME, Linear(0.1), 1e-8)], "linear").noise
    largest = FRAME.force(Linear(0.1), np.radians(40.0))
    assert tiny / largest == pytest.approx([1e-8], rel=0.2)
    quiet = [specimen(BIAS, Linear(0.1), 0.001, i) for i in range(2)]
    alone = of_shear(quiet, "linear")
    mixed = of_shear([*quiet, specimen(BIAS, Linear(0.1), 0.3, 7)], "linear")
    assert mixed.values == pytest.approx(alone.values, rel=1e-5)
    assert np.ptp(mixed.intervals) == pytest.approx(np.ptp(alone.intervals), rel=0.05)


def test_specimens_that_differ_beyond_noise_widen_the_band():
    same, unlike = (
        [specimen(BIAS, QUINTIC, 0.01, i, scale=1 + x * (i - 1)) for i in range(3)]
        for x in (0.0, 0.1)
    )
    assert not of_shear(same).beyond_noise
    fit = fit_shear(unlike)
    assert fit.parts["shear"].beyond_noise
    low, high = of_shear(unlike, "linear").intervals[0]
    assert high - low > 0.4 * low  # t(2) times 10 %/√3 to either side
    last = shear_report(fit)["moments"][-1]
    assert last["between_specimens"] / last["moment"] == pytest.approx(0.1, rel=0.1)
    assert "curves differ significantly" in notes(fit)


def test_lack_of_fit_and_undetermined_parameters_are_reported():
    """The bands of the third and fifth power of a straight line contain zero."""
    data, straight = (
        specimen(BIAS, law, x, 1) for law, x in ((QUINTIC, 0.005), (Linear(0.1), 0.02))
    )
    assert "does not represent the curve" in notes(fit_shear([data], "linear"))
    assert notes(fit_shear([data])) == ""
    undetermined = notes(fit_shear([straight]))
    assert "the bands of c3, c5 contain 0 or a limit" in undetermined
    assert "contain 0" not in notes(fit_shear([straight], "linear"))


def test_parameters_at_their_bounds_have_no_band():
    data = [specimen(BIAS, QUINTIC, 0.01)]
    fit = fit_shear(data, bounds={"c3": (0.0, 1.0)})
    assert fit.parts["shear"].values[1] == 0.0
    assert fit.parts["shear"].at_bound.tolist() == [False, True, False]
    assert fit.parts["shear"].intervals[1].tolist() == [0.0, 0.0]
    assert "at a bound, which have no confidence band: c3" in notes(fit)
    ends = {"c1": (0.5, 1.0), "c3": (0.1, 1.0), "c5": (0.9, 1.0)}
    every = of_shear([specimen(BIAS, QUINTIC)], bounds=ends)
    assert every.at_bound.all()
    assert every.intervals.tolist() == [[0.5, 0.5], [0.1, 0.1], [0.9, 0.9]]


def test_points_beyond_the_kinematics_are_excluded():
    data = specimen(BIAS, QUINTIC, end=60.0, n=60)
    fit = fit_shear([data])
    assert np.degrees(fit.largest_angle) == pytest.approx(40.0)
    assert shear_report(fit)["curves"][0]["left_out"] == 20
    further = fit_shear([data], up_to=np.radians(50.0))
    assert np.degrees(further.largest_angle) == pytest.approx(50.0)
    assert "fit by simulation" in notes(further)
    (said,) = data_report(fit)
    assert said["test"] == "bias extension, 100 × 200 mm, fibres at 45°"
    assert said["prepared"] == [
        "40 of 60 points are fitted, up to a theoretical shear angle of 40.0°"
    ]


def slipping(test, end=60.0, onset=30.0):
    """A test whose measured angle is behind beyond an onset in degrees."""
    gamma = np.radians(np.arange(1.0, end + 1))
    late = 0.5 * np.maximum(gamma - np.radians(onset), 0.0)
    moved = test.displacement(gamma)
    return Specimen("one", test, test.force(QUINTIC, gamma), moved, gamma - late)


def test_a_measured_angle_overrides_the_theoretical_one_and_shows_its_limit():
    gamma = np.radians(np.arange(1.0, 51.0))
    slip = 0.45 * np.maximum(gamma - np.radians(35.0), 0.0)
    moved = BIAS.displacement(gamma + slip)
    data = Specimen("one", BIAS, BIAS.force(QUINTIC, gamma), moved, gamma)
    fit = fit_shear([data])
    np.testing.assert_allclose(
        fit.laws["shear"].coefficients, QUINTIC.coefficients, rtol=1e-8
    )
    assert np.degrees(data.kinematics_limit) == pytest.approx(39.0)  # 2 degrees
    assert np.degrees(fit.largest_angle) == pytest.approx(39.0)
    further = fit_shear([data], up_to=np.radians(50.0))
    assert np.degrees(further.largest_angle) == pytest.approx(50.0)
    assert "beyond 39.0 degrees" in notes(further)


def test_the_limit_of_the_kinematics_is_within_the_test_and_not_due_to_noise():
    gamma = np.radians(np.linspace(1.0, 45.0, 200))
    measured = gamma + np.radians(1.0) * np.random.default_rng(1).standard_normal(200)
    data = Specimen("one", BIAS, gamma, BIAS.displacement(gamma), measured)
    assert np.degrees(data.kinematics_limit) > 44.0
    theta = np.radians(75.0)
    steep = BiasExtension(100.0, 200 * np.tan(theta), theta)
    limit = specimen(steep, QUINTIC, end=20.0).kinematics_limit
    assert np.degrees(limit) == pytest.approx(30.0)


def test_the_picture_of_a_law_contains_it_and_its_band():
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    from skfem_textile.calibration.figure import law_panels

    fit, axes = fit_shear([specimen(FRAME, QUINTIC, 0.01)]), Figure().subplots()
    _, moments = law_panels(fit, "shear").values()
    moments(axes)
    assert axes.get_ylabel() == "shear moment C (N·mm/mm²)"
    largest = fit.laws["shear"].value(np.radians(40.0))
    assert axes.get_ylim()[1] == pytest.approx(1.3 * largest, rel=0.01)


def test_a_frame_imposes_its_angle_over_the_whole_range():
    fit = fit_shear([specimen(FRAME, QUINTIC, end=60.0, n=60)])
    assert np.degrees(fit.largest_angle) == pytest.approx(60.0)
    assert shear_report(fit)["kinematics_hold_to_deg"] == pytest.approx(90.0)
    data = slipping(FRAME)
    slipped = fit_shear([data])
    largest = np.degrees(data.measured_angle.max())
    assert np.degrees(slipped.largest_angle) == pytest.approx(largest)
    assert "differs from the angle of the frame by up to 14.5 degrees" in notes(slipped)
    assert "angle of the frame" not in notes(fit_shear([slipping(FRAME, onset=80.0)]))


def test_loading_and_unloading_in_one_curve_are_reported():
    data = specimen(BIAS, QUINTIC, 0.01)
    loading, back = data.displacement, data.displacement[::-1]
    forces = np.concatenate([data.force, 0.7 * data.force[::-1]])
    cycle = Specimen("cycle", BIAS, forces, np.concatenate([loading, back]))
    assert "cycle: the test contains loading and unloading" in notes(fit_shear([cycle]))
    shaken = loading + 0.01 * loading[-1] * np.random.default_rng(1).standard_normal(60)
    shaken = Specimen("one", BIAS, data.force, shaken)
    assert "loading and unloading" not in notes(fit_shear([shaken]))


def test_the_inverse_fit_accounts_for_fibre_stretch():
    """Soft fibres reduce the load, which the closed form attributes to a softer law."""
    soft = Simulation(tension=250.0, across=2, steps=3)
    angles, forces, _ = soft.curve(Linear(0.5), NARROW, np.radians(48.0))
    lost = forces[1:] / NARROW.force(Linear(0.5), angles[1:])
    assert lost[-1] < 0.92
    data = [Specimen("one", NARROW, forces[1:], NARROW.displacement(angles[1:]))]
    fit = fit_shear(data, "linear", soft)
    assert fit.simulations
    assert fit.laws["shear"].stiffness == pytest.approx(0.5, rel=2e-3)
    assert of_shear(data, "linear").law.stiffness < 0.48


def test_a_large_stabilisation_energy_is_reported():
    coarse, fine = (
        fit_shear([specimen(NARROW, Linear(0.5), n=6, end=end)], "linear", settings)
        for end, settings in (
            (45.0, Simulation(across=2, steps=1)),
            (25.0, Simulation(across=6, steps=1)),
        )
    )
    assert fine.stabilisation < 0.1 < coarse.stabilisation
    assert "double --simulate" in notes(coarse)
    assert "double --simulate" not in notes(fine)
    closed = fit_shear([specimen(NARROW, Linear(0.5))], "linear")
    assert closed.stabilisation is None


def test_a_simulation_ends_where_the_measured_angle_shows_slip():
    data = slipping(NARROW, end=45.0)
    fit = fit_shear([data], "linear", COARSE)
    assert np.degrees(fit.largest_angle) == pytest.approx(34.0, abs=0.5)
    said = "beyond 34.0 degrees the measured angle differs from the theoretical one"
    assert said in notes(fit)
    assert "the range ends there (--up-to)" in notes(fit)
    further = fit_shear([data], "linear", COARSE, up_to=np.radians(40.0))
    assert np.degrees(further.largest_angle) == pytest.approx(40.0, abs=0.5)
    assert "points up to 40.0 degrees are fitted" in notes(further)


def test_a_table_ends_beyond_the_data_and_a_crimped_law_has_a_stiffness_at_rest():
    end = tabulated(0.5, 3).build(np.arange(1.0, 4.0)).domain[1]
    assert end / 0.5 - 1 == pytest.approx(1e-12, rel=1e-3, abs=0)
    assert crimp_toe(0.1).build(np.array([1e4, 0.01])).initial_stiffness == 1.0
