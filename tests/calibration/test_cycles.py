"""Friction of a law from tests with loading and unloading."""

import numpy as np
import pytest

from skfem_textile import Bilinear, CrimpToe, Linear, Polynomial, WithFriction
from skfem_textile.calibration import (
    BendingCurve,
    BiasExtension,
    Choice,
    PictureFrame,
    Preparation,
    Specimen,
    Strip,
    fit_tests,
    read_specimens,
)
from skfem_textile.fabric import along
from skfem_textile.fabric.files import read_law
from tests.helpers.command_line import fit, summary_in

ELASTIC = Polynomial((0.1, 0.0, 0.6))
LAW = WithFriction(ELASTIC, [0.01, 0.02], [0.02, 0.12])
FRAME, BIAS = PictureFrame(200.0, 160.0), BiasExtension(100.0, 250.0)
CUBIC = Choice("polynomial", degree=3)


def twice(most, n=60):
    """Displacements of two cycles of loading and unloading."""
    there = np.linspace(0.0, most, n)
    return np.concatenate([there, there[-2::-1], there[1:], there[-2::-1]])


def loops(test, law=LAW, noise=0.0, rows=slice(None), cyclic=True, n=60):
    """A shear test of a law over two cycles."""
    moved = twice(float(test.displacement(np.radians(np.array(40.0)))), n)
    gamma = test.shear_angle(moved)
    force = sum(arm * along(law, share * gamma)[0] for share, arm in test.arms(gamma))
    force += noise * force.max() * np.random.default_rng(1).normal(size=force.size)
    return Specimen("loops", test, force[rows], displacement=moved[rows], cyclic=cyclic)


@pytest.mark.parametrize("test", [FRAME, BIAS], ids=["frame", "bias"])
def test_shear_tests_identify_the_loop_and_the_elastic_law(test):
    fitted = fit_tests([loops(test, noise=0.003)], CUBIC).laws["shear"]
    gamma = np.radians(twice(40.0))
    (found, lost), (true, truly_lost) = (along(law, gamma) for law in (fitted, LAW))
    assert lost == pytest.approx(truly_lost, rel=0.02)
    np.testing.assert_allclose(found, true, atol=0.01 * true.max())
    angles = np.radians([10.0, 25.0, 40.0])
    np.testing.assert_allclose(
        fitted.law.value(angles), ELASTIC.value(angles), rtol=0.02
    )


def test_onsets_and_limits_are_found_exactly_from_exact_data():
    law = WithFriction(Linear(0.3), [0.01, 0.02], np.radians([1.3, 9.0]))
    fitted = fit_tests([loops(FRAME, law)], Choice("linear")).laws["shear"]
    np.testing.assert_allclose(fitted.onsets, law.onsets, rtol=1e-4)
    np.testing.assert_allclose(fitted.limits, law.limits, rtol=1e-4)
    assert fitted.law.stiffness == pytest.approx(0.3, rel=1e-4)


def test_a_strip_identifies_the_loop_in_tension():
    law = WithFriction(CrimpToe(2e3, 0.005, 200.0), [1.0, 3.0], [5e-4, 3e-3])
    moved = twice(2.0)
    strain = np.log1p(moved / 100.0)
    force = 50.0 * along(law, strain)[0] * np.exp(-strain)
    strip = Strip("strip", "warp", 50.0, 100.0, moved, force, cyclic=True)
    fitted = fit_tests([strip]).laws["warp"]
    (found, lost), (true, truly_lost) = (along(x, strain) for x in (fitted, law))
    assert lost == pytest.approx(truly_lost, rel=0.02)
    np.testing.assert_allclose(found, true, atol=0.01 * true.max())


@pytest.mark.dear("friction elements are searched for two laws")
def test_moments_identify_the_loop_in_bending():
    """Exactly for a linear law, and to 1 % of the energy lost for a bilinear one."""
    curvature = np.concatenate([twice(0.06), -twice(0.06)])
    for elastic, law in (Linear(6.0), "linear"), (Bilinear(6.0, 0.02, 2.0), "bilinear"):
        true = WithFriction(elastic, [0.01, 0.03], [1e-3, 8e-3])
        moment, truly_lost = along(true, curvature)
        curve = BendingCurve("curve", curvature, moment, cyclic=True)
        fitted = fit_tests([curve], Choice(bending=law)).laws["bending warp"]
        _, lost = along(fitted, curvature)
        assert lost == pytest.approx(truly_lost, rel=0.01)
        assert fitted.law.stiffness == pytest.approx(6.0, rel=0.01)
        if law == "linear":
            np.testing.assert_allclose(fitted.onsets, true.onsets, rtol=1e-4)
            np.testing.assert_allclose(fitted.limits, true.limits, rtol=1e-4)


def test_other_tests_of_the_part_have_the_same_friction():
    """A monotonic test of the same law adds no elastic stiffness."""
    alone, loading = loops(FRAME), loops(BIAS, rows=slice(0, 60), cyclic=False)
    laws = (fit_tests(x, CUBIC).laws["shear"] for x in ([alone], [alone, loading]))
    one, both = (law.law.value(np.radians([20.0, 40.0])) for law in laws)
    np.testing.assert_allclose(both, one, rtol=0.01)


@pytest.mark.parametrize(
    ("rows", "limit", "message"),
    [
        (slice(0, 60), 0.01, "loops: --cycles requires rows of loading and unloading"),
        (slice(None), 1e-300, "loops: unloading does not differ from loading"),
    ],
)
def test_tests_without_a_loop_are_refused(rows, limit, message):
    law = WithFriction(ELASTIC, [limit], [0.1])
    with pytest.raises(ValueError, match=message):
        fit_tests([loops(FRAME, law, rows=rows)], CUBIC)


def test_a_cycle_and_all_cycles_are_refused():
    with pytest.raises(ValueError, match="omit it, or --cycle"):
        Preparation(cycle=1, cycles=True)


def test_the_command_writes_the_law_with_friction(tmp_path, capsys):
    one, data = loops(FRAME, n=20), tmp_path / "loops.csv"
    rows = zip(one.displacement, one.force, strict=True)
    text = "displacement (mm),force (N)\n" + "".join(f"{x},{f}\n" for x, f in rows)
    data.write_text(text)
    sizes = "--frame-side 200 --fabric-side 160 --degree 3"
    zeros = "--slack 0 --force-at-rest 0"
    pytest.importorskip("matplotlib")
    out = tmp_path / "fit"
    fit("picture-frame", data, sizes, zeros, "--cycles", "--out", out, draw=True)
    page = (out / "report.html").read_text()
    assert "Loops of loading and unloading, with friction" in page
    law = read_law(tmp_path / "fit" / "law.json")
    assert isinstance(law, WithFriction)
    reported = summary_in(tmp_path / "fit")["laws"]["Shear"]["friction"]
    assert reported["limits_N_per_mm"] == list(law.limits)
    (curve,) = reported["curves"]
    measured, predicted = curve["work_measured_N_mm"], curve["work_predicted_N_mm"]
    assert predicted == pytest.approx(measured, rel=1e-3)
    assert measured == pytest.approx(np.trapezoid(one.force, one.displacement))
    printed = capsys.readouterr().out
    assert "loading and unloading of cycles 1 to 2 of 2 are used" in printed
    assert "Shear: friction elements with the limit at the onset" in printed
    assert "as one curve" not in printed
    cyclic = read_specimens(data, FRAME, choices=Preparation(cycles=True))
    assert [x.force.size for x in cyclic] == [one.force.size]
