"""Predictions of tests by the laws of a fabric, one function per kind of test.

Each returns the measured values of a test, and a function of the laws and the unknown
zeros that predicts them; a fit compares both.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric import BiaxialLaw, Linear, Tabulated, TwoLaws
from ..fabric.law import domain_of
from ..scenes.shear_test import ShearTest
from .bending import BendingCurve, CantileverTest
from .choice import Choice, Test
from .measured import FAMILIES, slack_range
from .simulation import SimulatedTest
from .solving import Laws, Offset, Sample
from .specimens import END_OF_RANGE, Specimen
from .tensile import BiaxialCurve, Strip


def samples_of(
    tests: Sequence[Test],
    choice: Choice,
    simulations: Mapping[ShearTest, SimulatedTest],
    tensions: tuple[str, ...],
) -> list[Sample]:
    """Curves of all tests with their predictions.

    Parameters
    ----------
    tests, choice
        The tests, and the chosen laws and range.
    simulations
        Simulations by test.
    tensions
        Tension laws with unknown parameters.
    """
    samples: list[Sample] = []
    for one in tests:
        if isinstance(one, Specimen):
            found = simulations.get(one.test)
            others = tensions if found else ()
            samples.append(shear(one, choice.up_to, found, others))
        elif isinstance(one, CantileverTest):
            samples.append(cantilever(one))
        elif isinstance(one, BendingCurve):
            samples.append(bending_curve(one))
        elif isinstance(one, Strip):
            samples.append(strip(one))
        elif choice.tension == "crimp-interchange":
            samples.append(biaxial_coupled(one))
        else:
            samples += [biaxial(one, 0), biaxial(one, 1)]
    return samples


def strip(test: Strip) -> Sample:
    """Force of a strip, F = W T(ε)/λ, with λ = 1 + (δ − δ₀)/L and the slack δ₀."""
    offsets: tuple[Offset, ...] = ()
    if test.slack is None:
        low, high = slack_range(test.displacement)
        start = float(np.clip(test.assumed_slack or 0.0, low, high))
        offsets = (Offset("slack", "mm", start, low, high, True),)

    def predict(laws: Laws, slack: float = test.slack or 0.0) -> ndarray:
        strain, law = test.strain(slack), laws[test.family]
        law = _smooth(law) if offsets else law
        return test.width * law.value(strain) / np.exp(strain)

    return Sample(test.name, test.force, test.family, predict, offsets)


def biaxial(curve: BiaxialCurve, family: int) -> Sample:
    """Force along one family, F = W T(ε)/λ, for a law of one strain."""
    name = FAMILIES[family]
    offsets = tuple(_strain_slack(curve, i) for i in curve.loose if i == family)

    def predict(laws: Laws, slack: float = 0.0) -> ndarray:
        strain, law = curve.taut(family, slack), laws[name]
        law = _smooth(law) if offsets else law
        return curve.widths[family] * law.value(strain) / np.exp(strain)

    called = f"{curve.name}, {name}"
    return Sample(called, curve.force[family], name, predict, offsets)


def biaxial_coupled(curve: BiaxialCurve) -> Sample:
    """Forces along both families, for a law of both strains."""
    widths = np.reshape(curve.widths, (2, 1))

    def predict(laws: Laws, *slacks: float) -> ndarray:
        law = laws["both"]
        both = law if isinstance(law, BiaxialLaw) else TwoLaws(law, law)
        given = dict(zip(curve.loose, slacks, strict=bool(slacks)))
        strain = np.array([curve.taut(i, given.get(i, 0.0)) for i in range(2)])
        return (widths * np.asarray(both.value(strain)) / np.exp(strain)).ravel()

    offsets = tuple(_strain_slack(curve, i) for i in curve.loose)
    return Sample(curve.name, curve.force.ravel(), "both", predict, offsets)


def shear(
    specimen: Specimen,
    up_to: float | None,
    simulated: SimulatedTest | None = None,
    others: tuple[str, ...] = (),
) -> Sample:
    """Force of a picture frame or bias extension, F = Σ a C(s γ).

    For inextensible fibres, or by the kinematics of a simulation.  The zeros of a
    machine that are unknown are the arguments of a prediction after the laws: the force
    at rest, then the slack.

    Parameters
    ----------
    specimen
        The curve.
    up_to
        Shear angle in radians above which points are excluded; see `Specimen.used`.
    simulated
        Simulation of the test.
    others
        Tension laws with unknown parameters on which the simulation depends.
    """
    used = specimen.used(up_to)
    moved, zeros = specimen.displacement, specimen.zeros
    at_rest, most = zeros.force, float(np.abs(specimen.force[used]).max())
    offsets = []
    if at_rest is None:
        offsets.append(Offset("force at rest", "N", 0.0, -most, most, False))
    if specimen.assumes_slack:
        assert moved is not None
        low, high = slack_range(moved)
        start = float(np.clip(specimen.slack, low, high))
        offsets.append(Offset("slack", "mm", start, low, high, True))
    known = specimen.angle[used]

    def predict(laws: Laws, *unknown: float) -> ndarray:
        values = dict(zip((o.name for o in offsets), unknown, strict=bool(unknown)))
        law, gamma = laws["shear"], known
        if "slack" in values:
            assert moved is not None
            gamma = specimen.angle_at(moved[used], values["slack"])
            law = _smooth(law)
            # ends before a pole, and before the end of the test
            end = min(END_OF_RANGE * domain_of(law)[1], specimen.last_angle(np.inf))
            gamma = np.fmin(gamma, end)
        if simulated is None:
            force = specimen.test.force(law, gamma)
        else:
            force = simulated.force({**laws, "shear": law}, gamma)
        return force + values.get("force at rest", at_rest or 0.0)

    force = specimen.force[used]
    return Sample(specimen.name, force, "shear", predict, tuple(offsets), others)


def cantilever(test: CantileverTest) -> Sample:
    """Bending stiffness of each reading by the elastica, D = w L³/f(θ)."""
    part = f"bending {test.family}"

    def predict(laws: Laws) -> ndarray:
        if isinstance(law := laws[part], Linear):
            return law.value(np.ones(test.overhang.size))
        return test.apparent(_smooth(law))

    return Sample(test.name, test.by_elastica, part, predict)


def bending_curve(test: BendingCurve) -> Sample:
    """Moment of a law at each curvature."""
    part = f"bending {test.family}"

    def predict(laws: Laws) -> ndarray:
        value: ndarray = laws[part].value(test.curvature)
        return value

    return Sample(test.name, test.moment, part, predict)


def _smooth(law: Any) -> Any:
    """The law; a table beyond its end too, which an unknown slack may pass."""
    return law.extrapolated if isinstance(law, Tabulated) else law


def _strain_slack(curve: BiaxialCurve, family: int) -> Offset:
    """Unknown elongation per length at which a family is taut."""
    low, high = slack_range(np.expm1(curve.strain[family]))
    start = float(np.clip((curve.assumed_slack or (0.0, 0.0))[family], low, high))
    return Offset(f"{FAMILIES[family]} slack", "-", start, low, high, True)
