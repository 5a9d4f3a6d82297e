"""Tension laws from biaxial tests."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import CrimpInterchange, CrimpToe, Linear
from skfem_textile.calibration import BiaxialCurve, read_biaxial, residuals
from skfem_textile.calibration.report import data_report, reports_of
from skfem_textile.fabric import TwoLaws
from tests.helpers.fits import fit_tension, noisy, strip

RATIOS = (0.5, 1.0, 2.0)


WIDTHS = np.array([[100.0], [80.0]])


def pulls(law, noise=0.0):
    """Biaxial tests of a law at several strain ratios."""
    e, curves = np.linspace(0.0, 0.02, 21)[1:], []
    for seed, ratio in enumerate(RATIOS):
        strain = np.array([e, ratio * e]) / max(1.0, ratio)
        load = noisy(forces(law, strain), noise, seed)
        curves.append(BiaxialCurve(f"{ratio:g}", strain, load, (100.0, 80.0)))
    return curves


def forces(law, strain):
    """Forces of a law of both strains, shape (2, n)."""
    return WIDTHS * np.asarray(law.value(strain)) / np.exp(strain)


def test_two_crimped_families_are_identified_and_agree_with_uncoupled_laws():
    warp, weft = CrimpToe(5e3, 0.004, 10.0), CrimpToe(3e3, 0.006, 5.0)
    fit = fit_tension(pulls(TwoLaws(warp, weft), noise=0.01))
    (read, *_) = data_report(fit)
    assert read["test"] == "biaxial test, 100 mm wide to the warp, 80 mm to the weft"
    x = np.linspace(0.002, 0.02, 10)
    for law, truth in zip(fit.laws.values(), (warp, weft), strict=True):
        np.testing.assert_allclose(law.value(x), truth.value(x), rtol=0.05, atol=0.3)
    for report in reports_of(fit).values():
        assert not report["specimens_differ_beyond_noise"]


@pytest.mark.dear("two joint fits of coupled laws")
def test_crimp_interchange_contradicts_uncoupled_laws_and_is_identified():
    law = CrimpInterchange((2e3, 1.5e3), (0.01, 0.015), 5.0, 2e-3, 0.15)
    curves = pulls(law, noise=0.01)
    alone = reports_of(fit_tension(curves))
    assert "use crimp-interchange" in " ".join(alone["Tension of the warp"]["notes"])
    both = fit_tension(curves, "crimp-interchange").parts["both"]
    slopes = both.law.tangent(np.array([c.strain for c in curves]).swapaxes(0, 1))
    assert np.linalg.eigvalsh(np.moveaxis(slopes, (0, 1), (-2, -1))).min() > 0
    for i, curve in enumerate(curves):
        low, high = both.band(lambda law, x=curve.strain: forces(law, x).ravel())
        fitted = forces(both.law, curve.strain)
        assert np.all((low <= fitted.ravel()) & (fitted.ravel() <= high))
        np.testing.assert_allclose(both.predicted(i), fitted.ravel())
        largest = 0.01 * curve.force.max()
        np.testing.assert_allclose(fitted, forces(law, curve.strain), atol=largest)
    assert isinstance(both.law, CrimpInterchange)
    low, high = both.intervals.T
    truth = [2e3, 1.5e3, 0.01, 0.015, 5.0, 2e-3]
    assert np.sum((low <= truth) & (truth <= high)) >= 5  # of six at 95 %


def test_forces_are_those_of_a_homogeneous_stretch(tmp_path):
    """The force is W T(ln λ)/λ, from elongations per length."""
    header = "warp strain (%),weft strain (-),warp force (kN),weft force (N)\n"
    (tmp_path / "pull.csv").write_text(f"{header}2,0.01,0.5,20\n")
    (curve,) = read_biaxial(tmp_path / "pull.csv", (100.0, 80.0))
    np.testing.assert_allclose(curve.strain[:, 0], np.log([1.02, 1.01]))
    tensions = [curve.along(i).tension[0] for i in range(2)]
    np.testing.assert_allclose(tensions, [5.0 * 1.02, 0.25 * 1.01])
    law = CrimpToe(5e3, 0.004, 10.0)
    expected = 100.0 * law.value(np.log([1.02])) / 1.02
    alone = residuals.biaxial(curve, 0).predict({"warp": law})
    np.testing.assert_allclose(alone, expected)
    both = residuals.biaxial_coupled(curve).predict({"both": TwoLaws(law, law)})
    np.testing.assert_allclose(both[0], expected)
    np.testing.assert_allclose(both[1], 80.0 * law.value(np.log([1.01])) / 1.01)


def test_the_family_with_the_larger_strain_determines_the_loading(tmp_path):
    e = np.append(np.linspace(0.0, 0.05, 50), np.linspace(0.05, 0.0, 50))
    columns = np.transpose([0.001 * np.linspace(0, 1, 100), e, 50 * e, 9e3 * e])
    header = "warp strain (-),weft strain (-),warp force (N),weft force (N)"
    np.savetxt(tmp_path / "a.csv", columns, delimiter=",", header=header, comments="")
    (curve,) = read_biaxial(tmp_path / "a.csv", (100.0, 80.0))
    assert curve.strain.shape[1] in range(48, 53)
    assert np.all(np.diff(curve.strain[1][:48]) > 0)


def test_a_family_unloaded_in_one_test_is_identified_from_the_others():
    law = CrimpToe(5e3, 0.004, 10.0)
    pull, *_ = pulls(TwoLaws(law, law), noise=0.001)
    alone = np.array([[1.0], [0.0]])
    free = replace(pull, strain=pull.strain * alone, force=pull.force * alone)
    reports = reports_of(fit_tension([pull, free]))
    assert reports["Tension of the weft"]["largest_strain"] == pytest.approx(0.01)
    assert reports["Tension of the warp"]["largest_strain"] == pytest.approx(0.02)
    _, unloaded = reports["Tension of the weft"]["curves"]
    assert np.isnan(unloaded["noise_over_largest"])


def test_a_parameter_at_its_bound_is_reported():
    """The noise would give a negative stiffness at rest."""
    e, rng = np.linspace(0.0, 0.02, 41)[1:], np.random.default_rng(0)
    law = CrimpToe(5e3, 0.004, 0.0)
    force = 100 * law.value(e) / np.exp(e)
    force -= 20.0 * np.exp(-e / 0.003) + rng.standard_normal(40)
    curve = BiaxialCurve("one", np.array([e, e]), np.array([force] * 2), (100.0, 100.0))
    fit = fit_tension([curve]).parts["warp"]
    assert fit.values[2] == 0.0
    assert fit.at_bound.tolist() == [False, False, True]


def test_strips_that_differ_are_not_referred_to_crimp_interchange():
    """It refuses strips."""
    moved = np.linspace(0.1, 4.0, 40)
    strips = [strip(Linear(E), moved, 0.003, i) for i, E in enumerate((360.0, 400.0))]
    notes = " ".join(reports_of(fit_tension(strips))["Tension of the warp"]["notes"])
    assert "curves differ significantly" in notes
    assert "crimp-interchange" not in notes
