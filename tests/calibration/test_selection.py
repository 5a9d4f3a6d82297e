"""The choice among laws, laws that are not physical, and the scatter of specimens."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from skfem_textile import CrimpToe, Linear, Polynomial
from skfem_textile.calibration import Choice, Zeros, fitting, selection
from skfem_textile.calibration.report import reports_of
from skfem_textile.calibration.selection import (
    Candidate,
    best_of,
    cross_validated,
    with_best,
)
from tests.helpers import fits
from tests.helpers.fits import FRAME, fit_shear, fit_tension, of_shear


def specimen(law, seed=0, noise=0.01, scale=1.0):
    gamma = np.radians(np.linspace(1.0, 50.0, 50))
    return fits.specimen(FRAME, law, gamma, noise, seed, scale)


@cache
def chosen(law):
    """Fit of the best law to a frame of this one."""
    return fit_shear([specimen(law)], "auto", points=3)


def test_the_law_of_the_data_is_chosen_by_cross_validation():
    result = chosen(Linear(0.2))
    assert result.parts["shear"].model.name == "linear"
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
    fit = of_shear(heavy, "linear")
    found = cross_validated("linear", fit.model, fit.samples, lambda fit: "")
    assert found.zeros == 1
    assert 0.006 < found.error < 0.012


def test_the_standard_error_is_that_of_the_root_of_the_mean_square(monkeypatch):
    """Of mean squares 1, 4 and 9: s/√3 over twice the root."""
    fit = of_shear([specimen(Linear(0.2))], "linear")
    folds = [np.full(5, error) for error in (1.0, 2.0, -3.0)]
    monkeypatch.setattr(selection, "_left_out", lambda *of: folds)
    found = cross_validated("linear", fit.model, fit.samples, lambda fit: "")
    assert found.error == pytest.approx(np.sqrt(14 / 3))
    expected = np.sqrt(49 / 3) / np.sqrt(3) / (2 * np.sqrt(14 / 3))
    assert found.standard_error == pytest.approx(expected)


def test_a_polynomial_of_the_lowest_degree_that_suffices_is_chosen():
    """Higher degrees fit the noise, and their errors are not smaller."""
    result = chosen(Polynomial((0.1, 0.0, 0.2)))
    assert result.parts["shear"].model.name == "polynomial"
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
    pull = fits.strip(CrimpToe(2e3, 0.006, 200.0), np.linspace(0.0, 6.0, 30), 0.005)
    toe = fit_tension([pull], "auto", points=3)
    assert toe.parts["warp"].model.name == "crimp-toe"


def test_the_scatter_of_specimens_is_apart_from_the_band_of_the_mean():
    """A further one is within the mean ± t s √(1 + 1/m), t(4) = 2.776 at 95 %."""
    scales, gamma = np.array([0.9, 0.95, 1.0, 1.2, 1.1]), np.radians([20.0, 40.0])

    def value(law):
        return law.value(gamma)

    tests = [specimen(Linear(0.2), i, 1e-5, scale) for i, scale in enumerate(scales)]
    fit = fit_shear(tests, "linear").parts["shear"]
    each = 0.2 * gamma * scales[:, None]
    half = 2.776445 * each.std(axis=0, ddof=1) * np.sqrt(1 + 1 / 5)
    expected = each.mean(axis=0) + [[-1.0], [1.0]] * half
    np.testing.assert_allclose(fit.scatter(value), expected, rtol=1e-4)
    mean = np.ptp(fit.band(value), axis=0)
    np.testing.assert_allclose(mean / (2 * half), 1 / np.sqrt(6), rtol=0.1)
    assert fit_shear(tests[:2], "linear").parts["shear"].scatter(value) is None


def test_the_next_law_is_fitted_if_the_best_is_not_physical(monkeypatch):
    """The range of the final fit is its own, where a law may not be physical."""
    data, first = [specimen(Linear(0.2))], chosen(Linear(0.2))
    name = first.parts["shear"].model.name

    def against(fit, largest):
        return "it is refused" if fit.model.name == name else ""

    monkeypatch.setattr(fitting, "compared", lambda *of: first.candidates)
    monkeypatch.setattr(fitting, "reason_against", against)
    second = fit_shear(data, "auto")
    assert second.parts["shear"].model.name != name
    reasons = {one.reason for one in second.candidates["shear"]}
    assert "it is refused" in reasons
    monkeypatch.setattr(fitting, "reason_against", lambda *of: "it is refused")
    with pytest.raises(ValueError, match="no law suits these data, such as linear"):
        fit_shear(data, "auto")


def test_both_families_have_a_law_that_suits_both():
    """The best law of one family may not be physical for the other."""
    linear, toe = Candidate("linear", 1, 0.3, 0.0), Candidate("crimp-toe", 1, 0.2, 0.0)
    table, falls = (Candidate("tabulated", 1, 0.01, 0.0, x) for x in ("", "falls"))
    candidates = {"warp": [linear, toe, table], "weft": [linear, toe, falls]}
    assert with_best(Choice(tension="auto"), candidates).tension == "crimp-toe"
