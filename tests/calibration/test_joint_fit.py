"""Several kinds of tests of one fabric in one fit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from skfem_textile import CrimpToe, Linear, Locking
from skfem_textile.calibration import (
    BiasExtension,
    BiaxialCurve,
    CantileverTest,
    Choice,
    Simulation,
    fit_tests,
    fitting,
    residuals,
)
from skfem_textile.calibration.report import joint_report, reports_of
from skfem_textile.fabric import TwoLaws
from tests.helpers.fits import BIAS, FRAME, noisy, specimen, strip

# Claims about statistics of many fits are in `python -m studies laboratory`.

LAWS = {"warp": Linear(2000.0), "weft": Linear(1500.0), "shear": Locking(0.08, 1.2)}
COARSE = Simulation(across=2, steps=2)
CHOICE = Choice(shear="locking", tension="linear")


@cache
def of_bias_extension(end):
    """Simulation of the fabric of `LAWS` up to a shear angle."""
    return COARSE.test(LAWS, BIAS, end)


def drawn(noise):
    """Tests of the fabric of `LAWS` by kind."""
    moved = np.linspace(0.0, 6.0, 40)
    weft = strip(LAWS["weft"], moved, noise, 2)
    strain = np.log1p(np.linspace(0.0, 0.03, 40) * [[1.0], [0.5]])
    families = zip(("warp", "weft"), strain, strict=True)
    loads = 100.0 * np.array([LAWS[name].value(x) for name, x in families])
    pulled = noisy(loads / np.exp(strain), noise, 5)
    gamma, bent = np.radians(np.linspace(1.0, 40.0, 30)), np.radians(41.5)
    frame = np.radians(np.linspace(1.0, 55.0, 40))
    simulated = noisy(of_bias_extension(float(gamma[-1])).force(LAWS, gamma), noise, 4)
    one = CantileverTest("a", np.ones(1), np.full(1, bent), 6e-6)
    lengths = np.cbrt(5.0 / one.by_elastica[0]) * (1 + noise * np.linspace(-1, 1, 7))
    return {
        "strip": [strip(LAWS["warp"], moved, noise, 1), replace(weft, family="weft")],
        "picture frame": [specimen(FRAME, LAWS["shear"], frame, noise, 3)],
        "bias extension": [
            replace(specimen(BIAS, LAWS["shear"], gamma), force=simulated)
        ],
        "biaxial": [BiaxialCurve("two", strain, pulled, (100.0, 100.0))],
        "cantilever": [CantileverTest("bent", lengths, np.full(7, bent), 6e-6)],
    }


def fitted(tests, *kinds):
    simulation = COARSE if "bias extension" in kinds else None
    return fit_tests([one for kind in kinds for one in tests[kind]], CHOICE, simulation)


def widths(result):
    """Widths of the bands of all parameters by name."""
    joint = result.fit.joint
    bands = np.ptp(joint.intervals, axis=1)
    return dict(zip(joint.model.parameters, bands, strict=True))


@pytest.mark.dear("one fit by simulation of five kinds of tests, and fits of each")
def test_five_tests_of_one_fabric_determine_all_parameters_at_once():
    tests = drawn(0.002)
    result = fitted(tests, *tests)
    for part, law in {**LAWS, "bending warp": Linear(5.0)}.items():
        truth = (law.stiffness, law.angle) if part == "shear" else law.stiffness
        np.testing.assert_allclose(result.parts[part].values, truth, rtol=0.015)
    # the band is never wider than by a kind of test alone, nor by tests of one law
    joint = widths(result)
    kinds = [kind for kind in tests if kind != "bias extension"]
    alone = {kind: widths(fitted(tests, kind)) for kind in kinds}
    for kind, of_kind in alone.items():
        for name, width in of_kind.items():
            assert joint[name] <= width * (1 + 1e-3), (kind, name)
    assert joint["warp stiffness"] < 0.9 * alone["biaxial"]["warp stiffness"]
    assert joint["shear angle"] < 0.9 * alone["picture frame"]["shear angle"]
    correlations = np.array(joint_report(result)["correlations"])
    np.testing.assert_allclose(np.diag(correlations), 1.0)
    assert abs(correlations[0, 2]) > 1e-6  # of the warp and the shear stiffness
    assert list(reports_of(result)) == [
        *("Tension of the warp", "Tension of the weft", "Shear", "Bending of the warp")
    ]


def test_laws_of_separate_tests_are_those_of_separate_fits():
    """Their bands too, with the degrees of freedom of these tests alone."""
    kinds, tests = ("strip", "picture frame", "cantilever"), drawn(0.01)
    loose = [replace(one, slack=None) for one in tests["strip"]]
    tests = tests | {"strip": loose}
    together = fitted(tests, *kinds)
    for kind in kinds:
        for part, alone in fitted(tests, kind).parts.items():
            joint = together.parts[part]
            np.testing.assert_allclose(joint.values, alone.values, rtol=1e-6)
            np.testing.assert_allclose(joint.intervals, alone.intervals, rtol=1e-5)


def test_parameters_of_one_family_have_their_own_bounds():
    strips = drawn(0.01)["strip"]
    bound = Choice(tension="linear", bounds={"warp stiffness": (0.0, 1e3)})
    limited = fit_tests(strips, bound)
    assert limited.laws["warp"].stiffness == 1e3
    assert limited.laws["weft"].stiffness > 1.4e3


def test_a_crimped_strip_with_a_slack_has_a_stiffness_and_a_toe():
    """The initial stiffness is a share of the stiffness: the slack hides it.

    Fitted beside the slack, it varies by 20 times, and the stiffness by 20 %.
    """
    law, moved = CrimpToe(2e3, 0.004, 20.0), np.linspace(0.0, 6.0, 400)
    loose = strip(law, moved, 0.01, 1, 0.12, unknown=True)
    result = fit_tests([loose])
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
    known = fit_tests([replace(loose, slack=0.12)]).parts["warp"]
    assert known.model.parameters[2] == "initial_stiffness"


LOOSE = CrimpToe(2e3, 0.006, 20.0)


def loose_strip(law=LOOSE):
    """A strip of 200 mm, pulled by 10 mm with a slack of 4 mm."""
    return strip(law, np.linspace(0.0, 10.0, 60), 0.005, 1, 4.0, unknown=True)


def biaxial(law, slacks=(0.0, 0.0), noise=0.02, seed=1):
    """A biaxial test with elongations of 0.05 of the law of both families."""
    elongation = np.linspace(0.0, 0.05, 60) * np.ones((2, 1))
    taut = np.log1p(np.maximum(elongation - np.reshape(slacks, (2, 1)), 0.0))
    force = noisy(100.0 * law.value(taut) / np.exp(taut), noise, seed)
    strain = np.log1p(elongation)
    return BiaxialCurve("two", strain, force, (100.0, 100.0), slack_is_unknown=True)


def taut_strip(seed):
    return strip(Linear(2e3), np.linspace(0.0, 10.0, 80), 0.02, seed, unknown=True)


@pytest.mark.parametrize(
    ("test", "zeros"),
    [(taut_strip, 1), (lambda seed: biaxial(Linear(2e3), seed=seed), 2)],
)
def test_no_slack_is_invented_on_noisy_tests_in_tension(test, zeros):
    """An F-test at 5 % rejects zero in 1 of 20 by chance; 3 of 8 are improbable."""
    invented = 0
    for seed in range(8):
        result = fit_tests([test(seed)], Choice(tension="linear"))
        for name, fit in result.parts.items():
            (low, high), value = fit.intervals[0], fit.law.stiffness
            assert low <= value <= high, name
            invented += np.count_nonzero(np.concatenate(fit.offsets))
    assert invented < 3 * zeros


@pytest.mark.parametrize(
    ("test", "law"),
    [
        (loose_strip(), "crimp-toe"),
        (biaxial(LOOSE, (0.02, 0.01), 0.005), "crimp-toe"),
        pytest.param(
            *(loose_strip(), "tabulated"),
            marks=pytest.mark.dear("a table has many parameters beside the slack"),
        ),
    ],
    ids=["strip", "biaxial", "table"],
)
def test_the_largest_strain_is_beyond_the_fitted_slack(test, law):
    """A table ends there."""
    result, taut = fit_tests([test], Choice(tension=law, points=3)), np.log1p(0.03)
    report = reports_of(result)["Tension of the warp"]
    assert report["largest_strain"] == pytest.approx(taut, abs=0.003)
    ((curve, _),) = result.along("warp")
    assert curve.along(0).strain.max() == pytest.approx(taut, abs=0.003)
    assert curve.along(0).strain[:10].max() == 0.0
    fitted = result.laws["warp"]
    slope = np.diff(fitted.value(np.array([0.015, 0.025]))) / 0.01
    assert slope == pytest.approx(LOOSE.stiffness, rel=0.05)
    if law == "tabulated":
        assert fitted.domain[1] == pytest.approx(taut, abs=0.003)


@pytest.mark.slow
def test_tension_laws_of_tests_with_a_slack_are_compared():
    for law, name in ((LOOSE, "crimp-toe"), (Linear(2e3), "linear")):
        result = fit_tests([loose_strip(law)], Choice(tension="auto"))
        assert result.choice.tension == name
        assert not any(one.reason for one in result.candidates["warp"])


def test_laws_are_compared_with_one_slack_of_each_test():
    for law in (LOOSE, Linear(2e3)):
        (one,) = fitting._within_range([loose_strip(law)], None)
        assert one.assumed_slack == pytest.approx(4.0, abs=0.1)


def test_each_family_of_a_biaxial_test_has_its_own_slack():
    fit = fit_tests([biaxial(LOOSE, (0.02, 0.01), 0.005)])
    found = [fit.parts[name].zeros(0)[f"{name} slack"][0] for name in ("warp", "weft")]
    assert found == pytest.approx([0.02, 0.01], abs=1e-3)
    for i, (name, taut) in enumerate((("warp", 0.03), ("weft", 0.04))):
        ((curve, _),) = fit.along(name)
        assert curve.along(i).strain.max() == pytest.approx(np.log1p(taut), abs=1e-3)
    coupled = residuals.biaxial_coupled(fit.tests[0])
    predicted = coupled.predict({"both": TwoLaws(LOOSE, LOOSE)}, 0.02, 0.01)
    measured = fit.tests[0].force
    np.testing.assert_allclose(predicted, measured.ravel(), atol=0.02 * measured.max())


def test_the_slack_of_a_family_is_within_the_range_of_its_own_strains():
    strain = np.log1p([np.linspace(0.0, 0.02, 60), np.linspace(0.0, 0.05, 60)])
    one = BiaxialCurve("one", strain, 1e3 * strain, (1.0, 1.0), slack_is_unknown=True)
    one = replace(one, assumed_slack=(0.001, 0.002))
    warp, weft = residuals.biaxial_coupled(one).offsets
    assert weft.high == pytest.approx(2.5 * warp.high)
    assert (warp.start, weft.start) == (0.001, 0.002)
    assert residuals.biaxial(one, 1).offsets == (weft,)


def test_a_family_that_is_not_stretched_has_no_slack():
    e = np.linspace(0.0, 0.02, 60)
    strain = np.log1p([e, -0.2 * e])
    law = CrimpToe(2e3, 0.004, 20.0)
    force = 100 * law.value(np.maximum(strain, 0.0)) / np.exp(strain)
    both = BiaxialCurve("both", strain[[0, 0]], force[[0, 0]], (100.0, 100.0))
    one = BiaxialCurve("one", strain, force, (100.0, 100.0), slack_is_unknown=True)
    assert [o.name for o in residuals.biaxial_coupled(one).offsets] == ["warp slack"]
    assert residuals.biaxial(one, 1).offsets == ()
    np.testing.assert_allclose(one.taut(1, 0.001), strain[1])
    found = fit_tests([both, one], Choice(tension="crimp-toe"))
    assert found.laws["weft"].stiffness == pytest.approx(2e3, rel=1e-2)


def test_the_range_of_each_shear_test_is_its_own():
    """A frame beyond 40 degrees does not extend the range of a bias extension."""
    specimens = [
        specimen(test, Linear(0.2), np.radians(np.linspace(1.0, end, 60)), 0.01, 1)
        for test, end in ((FRAME, 48.0), (BiasExtension(100.0, 250.0), 39.0))
    ]
    notes = reports_of(fit_tests(specimens, Choice("linear")))["Shear"]["notes"]
    assert not any("are fitted" in note for note in notes)
