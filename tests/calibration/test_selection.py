"""The choice among laws, laws that are not physical, and the scatter of specimens."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import CrimpToe, Linear, Locking, Polynomial
from skfem_textile.calibration import (
    Choice,
    PictureFrame,
    Specimen,
    Strip,
    Zeros,
    fit_tests,
    fitting,
)
from skfem_textile.calibration.comparison import with_best
from skfem_textile.calibration.report import reports_of
from skfem_textile.calibration.selection import Candidate, best_of
from tests.helpers.fits import fit_shear, fit_tension

FRAME = PictureFrame(200.0, 160.0)
SOFTENING = Polynomial((0.3, 0.0, -0.9, 0.0, 0.8))


def specimen(law, seed=0, noise=0.01, scale=1.0, end=50.0):
    gamma = np.radians(np.linspace(1.0, end, 60))
    force = scale * FRAME.force(law, gamma)
    force = force + noise * force.max() * np.random.default_rng(seed).normal(size=60)
    return Specimen(f"no. {seed}", FRAME, force, FRAME.displacement(gamma))


def strip(law, seed=0):
    moved = np.linspace(0.0, 6.0, 80)
    strain = np.log1p(moved / 200.0)
    force = 50.0 * law.value(strain) / np.exp(strain)
    force = force + 0.005 * force.max() * np.random.default_rng(seed).normal(size=80)
    return Strip("one", "warp", 50.0, 200.0, moved, force)


@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize(
    ("law", "name"),
    [
        (Linear(0.2), "linear"),
        (Locking(0.05, np.radians(60.0)), "locking"),
        (Polynomial((0.1, 0.0, -0.1, 0.0, 0.5)), "polynomial"),
    ],
)
def test_the_law_of_the_data_is_chosen_by_cross_validation(n, law, name):
    result = fit_shear([specimen(law, i) for i in range(n)], "auto")
    assert result.parts["shear"].model.name == name
    compared = {one.name: one for one in result.candidates["shear"]}
    assert len(compared) == 7
    listed = reports_of(result)["Shear"]["candidates"]
    assert [one["name"] for one in listed] == list(compared)


def test_a_curve_that_is_left_out_has_the_zeros_of_the_others():
    """With an unknown force at rest the remaining differences are the noise, 1 %."""
    heavy = [
        replace(one, force=one.force + 0.3 * one.force.max(), zeros=Zeros(force=None))
        for one in (specimen(Linear(0.2), i) for i in range(3))
    ]
    compared = fit_shear(heavy, "auto").candidates["shear"]
    assert 0.006 < min(one.error for one in compared) < 0.012


def test_a_polynomial_of_the_lowest_degree_that_suffices_is_chosen():
    """Higher degrees fit the noise, and their errors are not smaller."""
    result = fit_shear(
        [specimen(Polynomial((0.1, 0.0, 0.2))) for _ in range(1)], "auto"
    )
    assert result.choice.degree <= 3
    errors = {one.name: one.error for one in result.candidates["shear"]}
    assert errors["linear"] > 2 * errors["polynomial of degree 3"]
    assert 0.008 < errors["polynomial of degree 3"] < 0.012  # the noise


def test_of_laws_that_suit_the_one_with_the_fewest_zeros_is_chosen():
    """A force at rest below 0 and a negative slack turn a locking law into a cubic."""
    suits = [
        Candidate("linear", 1, 0.025, 0.0004, zeros=1),
        Candidate("locking", 2, 0.0097, 0.0002, zeros=1),
        Candidate("polynomial of degree 3", 2, 0.0096, 0.0004, zeros=2),
        Candidate("polynomial of degree 5", 3, 0.0098, 0.0003, zeros=1),
    ]
    assert best_of(suits).name == "locking"
    assert best_of(suits[2:]).name == "polynomial of degree 3"


def test_the_tension_law_is_chosen_by_cross_validation():
    toe = fit_tension([strip(CrimpToe(2e3, 0.006, 200.0))], "auto")
    assert toe.parts["warp"].model.name == "crimp-toe"
    straight = fit_tension([strip(Linear(2e3))], "auto")
    assert straight.parts["warp"].model.name == "linear"


def test_a_law_that_decreases_within_the_data_is_refused_in_one_line():
    with pytest.raises(ValueError, match="decreases between") as caught:
        fit_shear([specimen(SOFTENING, end=55.0)])
    message = str(caught.value)
    assert "the fitted law polynomial of the shear is not physical" in message
    assert "\n" not in message
    start = np.degrees(np.sqrt((2.7 - np.sqrt(2.7**2 - 4 * 4 * 0.3)) / 8))
    assert f"between {start:.0f}"[:10] in message
    bounded = {"c3": (0.0, 1.0)}
    assert fit_shear([specimen(SOFTENING, end=55.0)], bounds=bounded).parts


def test_a_pole_at_the_end_of_the_data_is_refused():
    data = specimen(Linear(0.01), noise=0.0)
    data.force[-1] *= 200.0
    with pytest.raises(ValueError, match="its pole is at the end of the data"):
        fit_shear([data], "locking")


def test_a_tension_that_decreases_is_refused():
    falling = strip(Linear(2e3))
    force = falling.force * (1.3 - 0.9 * falling.displacement / 6.0)
    one = Strip("one", "warp", 50.0, 200.0, falling.displacement, force)
    with pytest.raises(ValueError, match=r"tabulated of the warp .* strain"):
        fit_tests([one], Choice(tension="tabulated"))


def test_the_scatter_of_specimens_is_apart_from_the_band_of_the_mean():
    """A further specimen is within the band in 95 %; the mean has 1/√(m + 1) of it."""
    gamma, inside = np.radians([20.0, 40.0]), []

    def value(law):
        return law.value(gamma)

    rng = np.random.default_rng(1)
    for seed in range(200):
        scales = 1 + 0.1 * rng.standard_normal(6)
        tests = [
            specimen(Linear(0.2), 10 * seed + i, 0.01, scale)
            for i, scale in enumerate(scales[:5])
        ]
        fit = fit_shear(tests, "linear").parts["shear"]
        low, high = fit.scatter(value)
        further = value(Linear(0.2 * scales[5]))
        inside.append(bool(np.all((low <= further) & (further <= high))))
    assert 0.9 <= np.mean(inside) <= 0.99
    mean = np.ptp(fit.band(value), axis=0)
    np.testing.assert_allclose(mean / (high - low), 1 / np.sqrt(6), rtol=0.1)
    assert fit_shear(tests[:2], "linear").parts["shear"].scatter(value) is None


def test_an_unknown_law_is_refused_with_the_others_and_auto():
    with pytest.raises(ValueError, match="tabulated or auto"):
        Choice("spline")


@pytest.mark.parametrize("law", [Linear(0.2), Polynomial((0.1, 0.0, 0.2))])
def test_the_next_law_is_fitted_if_the_best_is_not_physical(monkeypatch, law):
    """The range of the final fit is its own, where a law may not be physical."""
    data = [specimen(law)]
    first = fit_shear(data, "auto")
    name = first.parts["shear"].model.name
    refused = []

    def against(fit, largest, unit):
        if fit.model.name == name:
            refused.append(fit)
        return "it is refused" if fit.model.name == name else ""

    monkeypatch.setattr(fitting, "reason_against", against)
    second = fit_shear(data, "auto")
    assert refused
    assert second.parts["shear"].model.name != name
    reasons = {one.reason for one in second.candidates["shear"]}
    assert "it is refused" in reasons
    monkeypatch.setattr(fitting, "reason_against", lambda *of: "it is refused")
    with pytest.raises(ValueError, match="no law suits these data, such as linear"):
        fit_shear(data, "auto")


def test_both_families_have_a_law_that_suits_both():
    """The best law of one family may not be physical for the other."""
    of_each = {
        "warp": [("linear", 0.3, ""), ("crimp-toe", 0.2, ""), ("tabulated", 0.01, "")],
        "weft": [
            ("linear", 0.3, ""),
            ("crimp-toe", 0.1, ""),
            ("tabulated", 0, "falls"),
        ],
    }
    candidates = {
        part: [Candidate(name, 1, error, 0.0, why) for name, error, why in each]
        for part, each in of_each.items()
    }
    assert with_best(Choice(tension="auto"), candidates).tension == "crimp-toe"
