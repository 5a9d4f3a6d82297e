"""Shear laws from curves of specimens."""

import numpy as np
import pytest

from skfem_textile import Linear, Locking, Polynomial, Sin2, Tabulated
from skfem_textile.calibration import (
    BiasExtension,
    PictureFrame,
    Simulation,
    Specimen,
)
from skfem_textile.calibration.report import data_report, shear_report
from skfem_textile.calibration.solving import covariance_of
from tests.helpers.fits import fit_shear, of_shear

QUINTIC = Polynomial((0.1, 0.0, -0.1, 0.0, 0.5))
TABLE = Tabulated(np.radians(5 * np.arange(9)), np.arange(9.0) ** 2, odd=True)
BIAS = BiasExtension(100.0, 200.0)
FRAME = PictureFrame(200.0, 160.0)


def specimen(test, law, noise=0.0, seed=0, n=60, end=40.0, name="one", scale=1.0):
    """A specimen of a law; the noise is a fraction of the largest force."""
    gamma = np.linspace(0.0, np.radians(end), n + 1)[1:]
    force = scale * test.force(law, gamma)
    force += noise * force.max() * np.random.default_rng(seed).standard_normal(n)
    return Specimen(name, test, force, test.displacement(gamma))


def notes(fit):
    return " ".join(shear_report(fit)["notes"])


@pytest.mark.parametrize("test", [BIAS, FRAME], ids=["bias", "frame"])
@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("linear", Linear(0.2)),
        ("sin2", Sin2(0.2)),
        ("polynomial", QUINTIC),
        ("locking", Locking(0.1, np.radians(60.0))),
        ("tabulated", TABLE),
    ],
)
def test_a_law_is_recovered_from_data_without_noise(test, name, law):
    gamma = np.radians(np.linspace(1.0, 39.9, 50))
    recovered = of_shear([specimen(test, law)], name).law
    assert type(recovered) is type(law)
    np.testing.assert_allclose(recovered.value(gamma), law.value(gamma), rtol=1e-5)


@pytest.mark.parametrize("test", [BIAS, FRAME], ids=["bias", "frame"])
def test_coefficients_are_within_their_bands_at_the_stated_rate(test):
    """The rate is 95 %: 90 to 99 % of 200 seeds, about three standard deviations."""
    inside = []
    for seed in range(200):
        three = [specimen(test, QUINTIC, 0.02, (seed, i)) for i in range(3)]
        low, high = of_shear(three).intervals.T
        truth = np.array(QUINTIC.coefficients[::2])
        inside.append((low <= truth) & (truth <= high))
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.945) < 0.045)


def test_the_band_accounts_for_estimated_weights():
    """The covariance is (JᵀWJ)⁻¹ (1 + 4 Σ s (1 − s)/ν), s = 1/3, ν = 59."""
    three = [specimen(FRAME, Linear(0.1), 0.02, i) for i in range(3)]
    fit = of_shear(three, "linear")
    J = fit.jacobian[:60, 0]
    weights = fit.noise**-2
    share = weights / weights.sum()
    more = 4 * np.sum(share * (1 - share) / (60 - share))
    expected = (1 + more) / (J @ J * weights.sum())
    assert fit.covariance[0, 0] == pytest.approx(expected, rel=1e-9)


def test_the_noise_of_each_specimen_is_reported():
    noises = (0.01, 0.02, 0.05)
    several = [specimen(BIAS, QUINTIC, x, i, n=400) for i, x in enumerate(noises)]
    computed = of_shear(several).noise / BIAS.force(QUINTIC, np.radians(40.0))
    np.testing.assert_allclose(computed, noises, rtol=0.15)


def test_noisy_specimens_have_less_weight():
    quiet = [specimen(BIAS, Linear(0.1), 0.001, i) for i in range(2)]
    wild = specimen(BIAS, Linear(0.1), 0.3, 7)
    alone = of_shear(quiet, "linear")
    mixed = of_shear([*quiet, wild], "linear")
    assert mixed.values == pytest.approx(alone.values, rel=1e-5)
    assert np.ptp(mixed.intervals) == pytest.approx(np.ptp(alone.intervals), rel=0.05)


def test_specimens_that_differ_beyond_noise_widen_the_band():
    same = [specimen(BIAS, QUINTIC, 0.01, i) for i in range(3)]
    unlike = [
        specimen(BIAS, QUINTIC, 0.01, i, scale=scale)
        for i, scale in enumerate((0.9, 1.0, 1.1))
    ]
    assert not of_shear(same).beyond_noise
    fit = fit_shear(unlike)
    assert fit.parts["shear"].beyond_noise
    low, high = of_shear(unlike, "linear").intervals[0]
    assert high - low > 0.4 * low  # t(2) times 10 %/√3 to either side
    last = shear_report(fit)["moments"][-1]
    assert last["between_specimens"] / last["moment"] == pytest.approx(0.1, rel=0.1)
    assert "curves differ significantly" in notes(fit)


def test_lack_of_fit_is_reported():
    data = [specimen(BIAS, QUINTIC, 0.005)]
    assert "does not represent the curve" in notes(fit_shear(data, "linear"))
    assert notes(fit_shear(data)) == ""


def test_a_parameter_at_its_bound_has_no_band():
    data = [specimen(BIAS, QUINTIC, 0.01)]
    fit = fit_shear(data, bounds={"c3": (0.0, 1.0)})
    assert fit.parts["shear"].values[1] == 0.0
    assert fit.parts["shear"].at_bound.tolist() == [False, True, False]
    assert fit.parts["shear"].intervals[1].tolist() == [0.0, 0.0]
    assert "at a bound, which have no confidence band: c3" in notes(fit)
    inside = of_shear(data, bounds={"c3": (-1.0, 1.0)})
    np.testing.assert_allclose(inside.values, of_shear(data).values)


def test_points_beyond_the_kinematics_are_excluded():
    data = specimen(BIAS, QUINTIC, end=60.0, n=60)
    fit = fit_shear([data])
    assert np.degrees(fit.largest_angle) == pytest.approx(40.0)
    assert shear_report(fit)["curves"][0]["left_out"] == 20
    further = fit_shear([data], up_to=np.radians(50.0))
    assert np.degrees(further.largest_angle) == pytest.approx(50.0)
    assert "fit by simulation" in notes(further)


def test_a_measured_angle_overrides_the_theoretical_one_and_shows_its_limit():
    gamma = np.radians(np.arange(1.0, 51.0))
    slip = np.where(gamma > np.radians(35.0), 0.45 * (gamma - np.radians(35.0)), 0.0)
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


def test_the_onset_of_slip_is_not_noise_of_the_measured_angle():
    gamma = np.radians(np.linspace(1.0, 45.0, 200))
    measured = gamma + np.radians(1.0) * np.random.default_rng(1).standard_normal(200)
    data = Specimen("one", BIAS, gamma, BIAS.displacement(gamma), measured)
    assert np.degrees(data.kinematics_limit) > 44.0


def test_a_frame_imposes_its_angle_over_the_whole_range():
    data = specimen(FRAME, QUINTIC, end=60.0, n=60)
    fit = fit_shear([data])
    assert np.degrees(fit.largest_angle) == pytest.approx(60.0)
    assert shear_report(fit)["kinematics_hold_to_deg"] == pytest.approx(90.0)


def test_specimens_that_cannot_be_fitted_are_rejected():
    data = specimen(BIAS, QUINTIC)
    few = specimen(BIAS, QUINTIC, n=3, end=39.0)
    for arguments, options, message in (
        (([data], "cubic"), {}, "unknown law 'cubic': choose one of polynomial"),
        (([data],), {"degree": 4}, "must be an odd number"),
        (([data],), {"up_to": -1.0}, "must be positive, got -57.2958 degrees"),
        (([data],), {"up_to": 1e-4}, "no shear angle is between 0 and 0.00573 degrees"),
        (([data],), {"bounds": {"c2": (0, 1)}}, "no parameter 'c2'"),
        (
            ([data], "linear"),
            {"bounds": {"stiffness": (-2, -1)}},
            "leave no number between",
        ),
        (([few],), {}, "3 points are too few for the 3 parameters"),
        (([data], "tabulated"), {"points": 0}, "at least one point"),
    ):
        with pytest.raises(ValueError, match=message):
            fit_shear(*arguments, **options)
    with pytest.raises(ValueError, match="only bias-extension tests"):
        fit_shear([specimen(FRAME, QUINTIC)], simulation=Simulation())
    with pytest.raises(ValueError, match="even and at least 2"):
        Simulation(across=5)


def one(force=lambda f: f, moved=lambda d: d, angle=None):
    """A specimen with some columns replaced by invalid ones."""
    data = specimen(BIAS, QUINTIC)
    forces = force(data.force)
    return Specimen("one", BIAS, forces, moved(data.displacement), angle)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (one(force=lambda f: -f), "one: the forces must be positive"),
        (one(force=lambda f: 0 * f + 3), "one: the force is 3 N at every point"),
        (
            one(moved=lambda d: -d),
            "0 and 40 degrees: the angles range from -2[0-9.]* to -0.6",
        ),
        (one(moved=lambda d: 1000 * d), "all displacements are beyond the end"),
        (
            one(angle=np.arange(1.0, 61.0)),
            "3438 degrees, but the test ends at 90",
        ),
    ],
)
def test_columns_of_a_wrong_sign_or_unit_are_reported(data, message):
    with pytest.raises(ValueError, match=message):
        fit_shear([data])


def test_loading_and_unloading_in_one_curve_are_reported():
    data = specimen(BIAS, QUINTIC, 0.01)
    loading, back = data.displacement, data.displacement[::-1]
    forces = np.concatenate([data.force, 0.7 * data.force[::-1]])
    cycle = Specimen("cycle", BIAS, forces, np.concatenate([loading, back]))
    assert "cycle: the test contains loading and unloading" in notes(fit_shear([cycle]))
    shaken = loading + 0.01 * loading[-1] * np.random.default_rng(1).standard_normal(60)
    noisy = Specimen("one", BIAS, data.force, shaken)
    assert "loading and unloading" not in notes(fit_shear([noisy]))


def test_the_limit_of_the_kinematics_is_within_the_test():
    theta = np.radians(75.0)
    strip = BiasExtension(100.0, 200 * np.tan(theta), theta)
    data = specimen(strip, QUINTIC, end=20.0)
    assert np.degrees(data.kinematics_limit) == pytest.approx(30.0)


def test_parameters_that_are_all_at_bounds_have_no_band():
    bounds = {"c1": (0.5, 1.0), "c3": (0.1, 1.0), "c5": (0.9, 1.0)}
    fit = of_shear([specimen(BIAS, QUINTIC)], bounds=bounds)
    assert fit.at_bound.all()
    assert fit.intervals.tolist() == [[0.5, 0.5], [0.1, 0.1], [0.9, 0.9]]


def test_parameters_that_differ_by_rounding_alone_have_no_covariance():
    x = np.linspace(0.0, 1.0, 50)
    with pytest.raises(ValueError, match="parameters are not identifiable"):
        covariance_of(np.transpose([x, x * (1 + 1e-14 * x)]), np.ones(50))


def test_the_range_of_a_specimen_is_stated():
    beyond = fit_shear([specimen(BIAS, QUINTIC, end=80)])
    (data,) = data_report(beyond)
    assert data["test"] == "bias extension, 100 × 200 mm, fibres at 45°"
    assert data["prepared"] == [
        "30 of 60 points are fitted, up to a theoretical shear angle of 40.0°"
    ]


def test_parameters_that_the_data_do_not_determine_are_reported():
    """The bands of the third and fifth power of a straight line contain zero."""
    data = [specimen(BIAS, Linear(0.1), 0.02, seed=1)]
    assert "the bands of c3, c5 contain 0 or a limit" in notes(fit_shear(data))
    assert "contain 0" not in notes(fit_shear(data, "linear"))


def test_the_inverse_fit_accounts_for_fibre_stretch():
    """Soft fibres reduce the load, which the closed form attributes to a softer law."""
    soft = Simulation(tension=500.0, across=4, steps=4)
    strip = BiasExtension(50.0, 100.0)
    angles, forces, _ = soft.curve(Linear(0.5), strip, np.radians(48.0))
    lost = forces[1:] / strip.force(Linear(0.5), angles[1:])
    assert lost[-1] < 0.9
    moved = strip.displacement(angles[1:])
    data = [Specimen("one", strip, forces[1:], moved)]
    fit = fit_shear(data, "linear", soft)
    assert fit.simulations
    assert fit.laws["shear"].stiffness == pytest.approx(0.5, rel=2e-3)
    assert of_shear(data, "linear").law.stiffness < 0.48


def test_a_large_stabilisation_energy_is_reported():
    strip = BiasExtension(50.0, 100.0)
    data = [specimen(strip, Linear(0.5), n=20, end=45.0)]
    coarse, fine = (
        fit_shear(data, "linear", Simulation(1e5, across, steps=4))
        for across in (4, 16)
    )
    assert fine.stabilisation < 0.1 < coarse.stabilisation
    assert "double --simulate" in notes(coarse)
    assert "double --simulate" not in notes(fine)
    assert fit_shear(data, "linear").stabilisation is None


def slipping(test, end=60.0, onset=30.0):
    """A test whose measured angle is behind beyond an onset in degrees."""
    gamma = np.radians(np.arange(1.0, end + 1))
    late = np.maximum(gamma - np.radians(onset), 0.0)
    moved = test.displacement(gamma)
    return Specimen("one", test, test.force(QUINTIC, gamma), moved, gamma - 0.5 * late)


def test_a_simulation_ends_where_the_measured_angle_shows_slip():
    data = slipping(BiasExtension(50.0, 100.0), end=45.0)
    coarse = Simulation(across=4, steps=4)
    fit = fit_shear([data], "linear", coarse)
    assert np.degrees(fit.largest_angle) == pytest.approx(34.0, abs=0.5)
    said = "beyond 34.0 degrees the measured angle differs from the theoretical one"
    assert said in notes(fit)
    assert "the range ends there (--up-to)" in notes(fit)
    further = fit_shear([data], "linear", coarse, up_to=np.radians(40.0))
    assert np.degrees(further.largest_angle) == pytest.approx(40.0, abs=0.5)
    assert "points up to 40.0 degrees are fitted" in notes(further)
    agreeing = fit_shear([slipping(data.test, 45.0, 80.0)], "linear", coarse)
    assert np.degrees(agreeing.largest_angle) == pytest.approx(45.0, abs=0.5)
    assert "not simulated" not in notes(agreeing)


def test_a_measured_angle_does_not_end_the_range_of_a_frame():
    data = slipping(FRAME)
    fit = fit_shear([data])
    largest = np.degrees(data.measured_angle.max())
    assert np.degrees(fit.largest_angle) == pytest.approx(largest)
    assert "differs from the angle of the frame by up to 14.5 degrees" in notes(fit)
    assert "angle of the frame" not in notes(fit_shear([slipping(FRAME, onset=80.0)]))
