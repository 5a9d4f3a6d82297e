"""Several kinds of tests of one fabric in one fit."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import CrimpToe, Fabric, Linear
from skfem_textile.calibration import (
    BiasExtension,
    BiaxialCurve,
    Choice,
    PictureFrame,
    Specimen,
    Strip,
    fit_tests,
    read_strips,
    residuals,
)
from skfem_textile.calibration.report import joint_report, reports_of
from studies.laboratory import fabric
from studies.laboratory.fabric import CHOICE, TRUTH, Drawn

# Claims about statistics of many fits are in `python -m studies laboratory`.


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """A coarse mesh, so that the simulations are fast."""
    monkeypatch.setattr(
        fabric, "SIMULATION", replace(fabric.SIMULATION, across=4, steps=4)
    )
    fabric.simulated.cache_clear()
    yield
    fabric.simulated.cache_clear()


def fitted(kinds, seed=1):
    tests = Drawn(seed).tests()
    every = [one for kind in kinds for one in tests[kind]]
    simulation = fabric.SIMULATION if "bias extension" in kinds else None
    return fit_tests(every, CHOICE, simulation)


def widths(result):
    """Widths of the bands of all parameters by name."""
    joint = result.fit.joint
    bands = np.ptp(joint.intervals, axis=1)
    return dict(zip(joint.model.parameters, bands, strict=True))


def test_five_tests_of_one_fabric_determine_all_parameters_at_once():
    kinds = tuple(Drawn(1).tests())
    result = fitted(kinds)
    assert list(result.parts) == list(TRUTH)
    for part, truth in TRUTH.items():
        np.testing.assert_allclose(result.parts[part].values, truth, rtol=0.02)
    # the band is never wider than by a kind of test alone, nor by tests of one law
    joint = widths(result)
    for kind in kinds:
        if kind == "bias extension":  # it needs a tension law
            continue
        for name, width in widths(fitted([kind])).items():
            assert joint[name] <= width * (1 + 1e-3), (kind, name)
    assert joint["warp stiffness"] < 0.9 * widths(fitted(["biaxial"]))["warp stiffness"]
    assert joint["shear angle"] < 0.9 * widths(fitted(["picture frame"]))["shear angle"]
    correlations = np.array(joint_report(result)["correlations"])
    np.testing.assert_allclose(np.diag(correlations), 1.0)
    assert abs(correlations[0, 2]) > 1e-6  # of the warp and the shear stiffness
    assert list(reports_of(result)) == [
        *("Tension of the warp", "Tension of the weft", "Shear"),
        *("Bending of the warp", "Bending of the weft"),
    ]


def test_a_bias_extension_is_wrong_by_the_stretch_of_its_fibres_without_them():
    tests = Drawn(1, noise=1e-6).tests()
    shear = [*tests["picture frame"], *tests["bias extension"]]
    stretched = fit_tests([*tests["strip"], *shear], CHOICE, fabric.SIMULATION)
    np.testing.assert_allclose(
        stretched.laws["shear"].stiffness, TRUTH["shear"][0], rtol=1e-3
    )
    assert fit_tests(shear, CHOICE).parts["shear"].beyond_noise
    stiff = fit_tests(tests["bias extension"], CHOICE).laws["shear"]
    assert abs(stiff.stiffness / TRUTH["shear"][0] - 1) > 0.02


def test_laws_of_separate_tests_are_those_of_separate_fits():
    """Their bands too, with the degrees of freedom of these tests alone."""
    kinds = "strip", "picture frame", "cantilever"
    together = fitted(kinds)
    for kind in kinds:
        for part, alone in fitted([kind]).parts.items():
            joint = together.parts[part]
            np.testing.assert_allclose(joint.values, alone.values, rtol=1e-6)
            np.testing.assert_allclose(joint.intervals, alone.intervals, rtol=1e-5)


def test_a_strip_determines_the_law_of_its_family_alone(tmp_path):
    e = np.linspace(0.0, 0.03, 50)
    force = 50.0 * 2e3 * np.log1p(e) / (1 + e)
    rows = "\n".join(f"{200 * x},{f}" for x, f in zip(e, force, strict=True))
    (tmp_path / "pull.csv").write_text(f"displacement (mm),force (N)\n{rows}\n")
    strips = read_strips(tmp_path / "pull.csv", "weft", 50.0, 200.0)
    result = fit_tests(strips, Choice(tension="linear"))
    assert list(result.parts) == ["weft"]
    assert result.laws["weft"].stiffness == pytest.approx(2e3)
    warp, weft = result.fabric(Fabric(7.0)).families
    assert (warp.tension.stiffness, weft.tension.stiffness) == (7.0, pytest.approx(2e3))


def test_a_strip_has_a_slack():
    law, moved = Linear(2e3), np.linspace(0.0, 8.0, 60)
    strain = np.log1p(np.maximum(moved - 1.5, 0.0) / 200.0)
    force = 50.0 * law.value(strain) / np.exp(strain)
    force += np.random.default_rng(1).normal(0.0, 10.0, 60)
    strip = Strip("one", "warp", 50.0, 200.0, moved, force, None)
    result = fit_tests([strip], Choice(tension="linear"))
    _, low, high = result.parts["warp"].zeros(0)["slack"]
    assert low < 1.5 < high
    assert result.laws["warp"].stiffness == pytest.approx(2e3, rel=0.02)
    zeroed = fit_tests([replace(strip, slack=0.0)], Choice(tension="linear"))
    assert zeroed.laws["warp"].stiffness < 1.9e3


@pytest.mark.parametrize("seed", range(5))
def test_a_crimped_strip_with_a_slack_has_a_stiffness_and_a_toe(seed):
    """The initial stiffness is a share of the stiffness: the slack hides it.

    Fitted beside the slack, it varies by 20 times, and the stiffness by 20 %.
    """
    law, moved = CrimpToe(2e3, 0.004, 20.0), np.linspace(0.0, 6.0, 400)
    strip = Strip("one", "warp", 50.0, 200.0, moved, np.zeros(400), None)
    force = residuals.strip(strip).predict({"warp": law}, 0.12)
    force += 0.01 * force.max() * np.random.default_rng(seed).standard_normal(400)
    result = fit_tests([replace(strip, force=force)])
    fit = result.parts["warp"]
    assert fit.model.parameters == ("stiffness", "toe")
    slope = law.stiffness + law.initial_stiffness  # of the taut strip
    assert fit.values == pytest.approx([slope, law.toe], rel=0.15)
    assert fit.values[0] == pytest.approx(slope, rel=0.02)
    (low, high), _ = fit.intervals
    assert high - low < 0.05 * slope
    assert "do not determine it: specify --slack" in " ".join(
        reports_of(result)["Tension of the warp"]["notes"]
    )
    known = fit_tests([replace(strip, force=force, slack=0.12)]).parts["warp"]
    assert known.model.parameters[2] == "initial_stiffness"


LOOSE = CrimpToe(2e3, 0.006, 20.0)


def loose_strip(law=LOOSE, slack=4.0, seed=1):
    """A strip of 200 mm, pulled by 10 mm with a slack in mm."""
    moved = np.linspace(0.0, 10.0, 120)
    strain = np.log1p(np.maximum(moved - slack, 0.0) / 200.0)
    force = 50.0 * law.value(strain) / np.exp(strain)
    force += 0.005 * force.max() * np.random.default_rng(seed).standard_normal(120)
    return Strip("one", "warp", 50.0, 200.0, moved, force, None)


def loose_biaxial():
    """A biaxial test with elongations of 0.05, and slacks of 0.02 and 0.01."""
    elongation = np.linspace(0.0, 0.05, 120)
    taut = np.log1p(np.maximum(elongation - [[0.02], [0.01]], 0.0))
    strain = np.log1p([elongation, elongation])
    force = 100.0 * LOOSE.value(taut) / np.exp(taut)
    force += 0.005 * force.max() * np.random.default_rng(1).standard_normal((2, 120))
    sizes = (100.0, 100.0)
    return BiaxialCurve("two", strain, force, sizes, slack_is_unknown=True)


def taut_biaxial(seed):
    """A biaxial test of a linear law without slack, with noise of 2 %."""
    strain = np.log1p(np.linspace(0.0, 0.05, 80) * np.ones((2, 1)))
    force = 100.0 * Linear(2e3).value(strain) / np.exp(strain)
    noise = np.random.default_rng(seed).standard_normal(strain.shape)
    force += 0.02 * force.max() * noise
    return BiaxialCurve("two", strain, force, (100.0, 100.0), slack_is_unknown=True)


def taut_strip(seed):
    """A strip of a linear law without slack, with noise of 2 %."""
    one = loose_strip(Linear(2e3), 0.0)
    noise = np.random.default_rng(seed).standard_normal(one.force.size)
    return replace(one, force=one.force + 0.02 * one.force.max() * noise)


@pytest.mark.parametrize(("test", "zeros"), [(taut_strip, 1), (taut_biaxial, 2)])
def test_no_slack_is_invented_on_noisy_tests_in_tension(test, zeros):
    """An F-test rejects each zero in 1 of 20 by chance; 4 of 10 are improbable."""
    invented = 0
    for seed in range(10):
        result = fit_tests([test(seed)], Choice(tension="linear"))
        for name, fit in result.parts.items():
            (low, high), value = fit.intervals[0], fit.law.stiffness
            assert low <= value <= high, name
            invented += np.count_nonzero(np.concatenate(fit.offsets))
    assert invented < 4 * zeros


@pytest.mark.parametrize("law", ["crimp-toe", "tabulated"])
@pytest.mark.parametrize("test", [loose_strip, loose_biaxial])
def test_the_largest_strain_is_beyond_the_fitted_slack(law, test):
    result = fit_tests([test()], Choice(tension=law))
    taut = np.log1p(0.03)
    report = reports_of(result)["Tension of the warp"]
    assert report["largest_strain"] == pytest.approx(taut, abs=0.003)
    ((curve, _),) = result.along("warp")
    assert curve.along(0).strain.max() == pytest.approx(taut, abs=0.003)
    assert curve.along(0).strain[:20].max() == 0.0


def test_a_table_with_a_slack_ends_at_the_largest_taut_strain():
    for test in (loose_strip(), loose_biaxial()):
        law = fit_tests([test], Choice(tension="tabulated")).laws["warp"]
        assert law.domain[1] == pytest.approx(np.log1p(0.03), abs=0.003)
        slope = np.diff(law.value(np.array([0.015, 0.028]))) / 0.013
        assert slope == pytest.approx(LOOSE.stiffness, rel=0.05)


def test_tension_laws_of_tests_with_a_slack_are_compared():
    for law, name in ((LOOSE, "crimp-toe"), (Linear(2e3), "linear")):
        result = fit_tests([loose_strip(law)], Choice(tension="auto"))
        assert result.choice.tension == name
        assert not any(one.reason for one in result.candidates["warp"])


def test_a_family_that_is_not_stretched_has_no_slack():
    e = np.linspace(0.0, 0.02, 60)
    strain = np.log1p([e, 0 * e])
    law = CrimpToe(2e3, 0.004, 20.0)
    force = 100 * law.value(strain) / np.exp(strain)
    both = BiaxialCurve("both", strain[[0, 0]], force[[0, 0]], (100.0, 100.0))
    one = BiaxialCurve("one", strain, force, (100.0, 100.0), slack_is_unknown=True)
    assert [o.name for o in residuals.biaxial_coupled(one).offsets] == ["warp slack"]
    assert residuals.biaxial(one, 1).offsets == ()
    found = fit_tests([both, one], Choice(tension="crimp-toe"))
    assert found.laws["weft"].stiffness == pytest.approx(2e3, rel=1e-2)


def test_tests_that_do_not_fit_together_are_refused():
    strips = Drawn(1).tests()["strip"]
    for tests, choice, message in (
        ([], Choice(), "no test is given"),
        (strips, Choice(tension="crimp-interchange"), "use biaxial tests alone"),
        (strips, Choice(bounds={"c1": (0, 1)}), "crimp-toe has no parameter 'c1'"),
        (strips, Choice(extrapolation="linear"), "omit the extrapolation"),
    ):
        with pytest.raises(ValueError, match=message):
            fit_tests(tests, choice)
    with pytest.raises(ValueError, match="only bias-extension tests"):
        fit_tests(strips, CHOICE, fabric.SIMULATION)
    with pytest.raises(ValueError, match="the family must be warp or weft"):
        replace(strips[0], family="fill")
    bound = Choice(tension="linear", bounds={"warp stiffness": (0.0, 1e3)})
    limited = fit_tests(strips, bound)
    assert limited.laws["warp"].stiffness == 1e3
    assert limited.laws["weft"].stiffness > 1.4e3


def test_a_frame_and_a_strip_of_the_other_family_do_not_disturb_each_other():
    frame = PictureFrame(200.0, 160.0)
    gamma = np.radians(np.linspace(1.0, 55.0, 60))
    force = frame.force(Linear(0.2), gamma)
    one = Specimen("one", frame, force, frame.displacement(gamma))
    both = fit_tests([one, *Drawn(1).tests()["strip"][:1]], Choice("linear", "linear"))
    assert both.laws["shear"].stiffness == pytest.approx(0.2)
    assert np.degrees(both.largest_angle) == pytest.approx(55.0)


def test_the_range_of_each_shear_test_is_its_own():
    """A frame beyond 40 degrees does not extend the range of a bias extension."""
    law, specimens = Linear(0.2), []
    for test, end in (
        (PictureFrame(200.0, 160.0), 48.0),
        (BiasExtension(100.0, 250.0), 39.0),
    ):
        gamma = np.radians(np.linspace(1.0, end, 60))
        force, moved = test.force(law, gamma), test.displacement(gamma)
        noise = 0.01 * force.max() * np.random.default_rng(1).normal(size=60)
        specimens.append(Specimen("one", test, force + noise, moved))
    notes = reports_of(fit_tests(specimens, Choice("linear")))["Shear"]["notes"]
    assert not any("are fitted" in note for note in notes)
