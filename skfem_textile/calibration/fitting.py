"""Laws of a fabric from tests of one or several kinds, in one least-squares problem."""

import logging
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric import Fabric
from ..fabric.law import domain_of
from ..fabric.origin import Origin, SpecimenLaw, with_laws
from ..scenes.shear_test import BiasExtension, ShearTest
from . import residuals
from .bands import Fit
from .bending import CantileverTest
from .choice import (
    AUTO,
    Choice,
    Test,
    in_tension,
    largest_argument,
    models_of,
    of_kind,
    reach,
    tests_of,
)
from .curves import beginning_notes
from .cycles import (
    Cyclic,
    FrictionElements,
    friction_of,
    in_cycles,
    predicted,
    without_friction,
)
from .measured import FAMILIES, families_of
from .regression import JointFit, fit
from .selection import (
    Candidate,
    compared,
    compared_in_bending,
    reason_against,
    with_best,
    without,
)
from .simulation import SimulatedTest, Simulation, simulated
from .solving import Laws
from .specimens import Specimen, Zeros
from .tensile import BiaxialCurve, Strip

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class FabricFit:
    """Laws of a fabric fitted to tests.

    Attributes
    ----------
    fit
        Parameters of all laws, their covariance, and of each law alone.
    tests
        The tests.
    choice
        Chosen laws and range.
    simulations
        Simulations of the bias extensions, by test; empty for closed forms.
    candidates
        Compared laws by part, where the choice was ``auto``.
    friction
        Friction by part, of tests with cycles; the forces of ``tests`` are without it.
    measured
        The tests as measured.
    """

    fit: JointFit
    tests: tuple[Test, ...]
    choice: Choice
    simulations: Mapping[ShearTest, SimulatedTest]
    candidates: Mapping[str, Sequence[Candidate]] = field(default_factory=dict)
    friction: Mapping[str, FrictionElements] = field(default_factory=dict)
    measured: tuple[Test, ...] = ()

    @property
    def parts(self) -> dict[str, Fit]:
        """Fit of each law by part, see `PARTS`."""
        return self.fit.parts

    @property
    def laws(self) -> dict[str, Any]:
        """Laws by part."""
        return {
            part: self.friction[part].added_to(law) if part in self.friction else law
            for part, law in self.fit.joint.law.items()
        }

    def fabric(self, base: Fabric, laws: Laws | None = None) -> Fabric:
        """A fabric whose laws are replaced by the fitted ones, or by laws by part."""
        return with_laws(base, self.laws if laws is None else laws)

    def origin(self) -> Origin:
        """Ranges of the data, and the laws of single specimens."""
        specimens = {
            part: tuple(
                SpecimenLaw(name, fit.model.build(values))
                for name, values in zip(fit.alone, fit.singles, strict=True)
            )
            for part, fit in self.parts.items()
            if fit.singles is not None
        }
        ranges = {
            part: largest_argument(self.tests, part, self.choice.up_to)
            for part in self.parts
            if part in ("shear", *FAMILIES)
        }
        counted = {part: len(fit.samples) for part, fit in self.parts.items()}
        sources = {
            part: f"law {self.parts[part].model.name}, fitted to {n} specimen"
            + "s" * (n > 1)
            for part, n in counted.items()
        }
        return Origin(sources=sources, ranges=ranges, specimens=specimens)

    @cached_property
    def specimens(self) -> tuple[Specimen, ...]:
        """Shear tests, in the order of the curves of the part ``shear``."""
        return tuple(of_kind(self.tests, Specimen))

    def zeroed(self, i: int) -> Specimen:
        """Shear test i with the zeros of the machine that were fitted."""
        one, zeros = self.specimens[i], self.parts["shear"].zeros(i)
        found = {
            key: zeros[name][0] if name in zeros else getattr(one.zeros, key)
            for key, name in (("slack", "slack"), ("force", "force at rest"))
        }
        return replace(one, zeros=Zeros(**found))

    def tests_of(self, part: str) -> Sequence[Test]:
        """Tests of a law, in the order of its curves."""
        return tests_of(self.tests, part)

    def along(self, part: str) -> list[tuple[Strip | BiaxialCurve, list[int]]]:
        """Tests of a tension law with fitted slacks, and their families."""
        tests, families = in_tension(self.tests_of(part)), families_of(part)
        return [(one.with_slack(self.zeros_of(one)), families) for one in tests]

    def zeros_of(self, test: Test) -> dict[str, float]:
        """Fitted zeros of a test by name."""
        return {
            name: value
            for part, fit in self.parts.items()
            for i, one in enumerate(self.tests_of(part))
            if one is test
            for name, (value, _, _) in fit.zeros(i).items()
        }

    def loops(self, part: str) -> list[tuple[Cyclic, ndarray]]:
        """Tests of a part with cycles, as measured, and the forces of the law."""
        both = self.tests_of(part), tests_of(self.measured, part)
        law, found = self.laws[part], []
        for fitted, measured in zip(*map(in_cycles, both), strict=True):
            zeros = self.zeros_of(fitted)
            one = measured.with_slack(zeros)
            force = predicted(one, law.law) + self.friction[part].force(one)
            found.append((one, force + zeros.get("force at rest", 0.0)))
        return found

    def cantilevers(self, part: str) -> list[CantileverTest]:
        """Cantilevers of a bending law, in the order of its curves."""
        return of_kind(self.tests_of(part), CantileverTest)

    @property
    def largest_angle(self) -> float:
        """Largest fitted shear angle in radians, with the fitted zeros of the machine.

        A law with a pole, or a table, ends at the angle of the estimated slack.
        """
        up_to, law = self.choice.up_to, self.parts["shear"].law
        estimated = max(reach(one, up_to) for one in self.specimens)
        used = (one.used(up_to) for one in self.specimens)
        angles = (self.zeroed(i).angle[rows] for i, rows in enumerate(used))
        fitted = max(float(one.max()) for one in angles)
        bounded = np.isfinite(domain_of(law)[1])
        return min(fitted, estimated) if bounded else fitted

    @property
    def stabilisation(self) -> float | None:
        """Largest energy share of the stabilisation; None without simulations."""
        shares = [one.stabilisation for one in self.simulations.values()]
        return max(shares, default=None)


# Convergence of the loads: relative change.  Chosen: a tenth of the uncertainty of a
# load from a curve with a noise of 1 %.
_SETTLED = 1e-3

# Relative difference of the ends of a law below which fits are equal: numerical error
# of the fitted slack.
_EQUAL = 1e-6

# Maximum number of simulations of each test, and of ranges; four are usual.
_MOST_ROUNDS = 10


def fit_tests(
    tests: Sequence[Test],
    choice: Choice | None = None,
    simulation: Simulation | None = None,
) -> FabricFit:
    """Fit the laws of a fabric to tests of one or several kinds.

    All tests enter one least-squares problem, each weighted by its noise.  Each kind of
    test determines some laws: shear tests the shear law, strips the tension law of one
    family, biaxial tests both, cantilevers and measured moments a bending stiffness or
    law.

    Parameters
    ----------
    tests
        The tests.
    choice
        Chosen laws and range.
    simulation
        Settings with which bias extensions are simulated, with the fitted tension laws
        if there are any.  Without it, their fibres do not stretch.

    Raises
    ------
    ValueError
        If there is no test; if a law decreases, or has a pole, within the data; if a
        specimen has no points in the range, angles that its
        test does not reach, or forces that are compressive or constant; if no fibre is
        stretched; if simulations fail or do not converge; or see `regression.fit`.

    Examples
    --------
    >>> from skfem_textile import Sin2
    >>> from skfem_textile.calibration import BiasExtension, Choice, Specimen, fit_tests
    >>> test, gamma = BiasExtension(100.0, 250.0), np.radians(np.arange(1.0, 40.0))
    >>> force = test.force(Sin2(0.3), gamma)
    >>> specimen = Specimen("one", test, force, displacement=test.displacement(gamma))
    >>> fit_tests([specimen], Choice("sin2")).laws["shear"].stiffness.__round__(9)
    0.3
    """
    choice = choice or Choice()
    if not tests:
        raise ValueError("no test is given")
    bias = [one for one in of_kind(tests, Specimen) if _is_bias(one)]
    if simulation is not None and not bias:
        raise ValueError("only bias-extension tests are simulated: omit the simulation")
    measured = tuple(tests)
    friction = _friction(tests, choice, simulation)
    tests = [without_friction(one, friction) for one in tests]
    candidates: dict[str, list[Candidate]] = {}
    if AUTO in (choice.shear, choice.tension):
        candidates = compared(_within_range(tests, choice.up_to), choice)
    candidates |= compared_in_bending(tests, choice)
    while True:
        chosen = with_best(choice, candidates)
        if simulation is None:
            result = fit_near(tests, chosen)
        else:
            result = _fitted_by_simulation(tests, chosen, simulation)
        reasons = _unphysical(result)
        if not reasons.keys() & candidates.keys():
            break
        candidates = without(candidates, chosen, reasons)
    _refuse_unphysical(result, reasons)
    return replace(result, candidates=candidates, friction=friction, measured=measured)


def _friction(
    tests: Sequence[Test], choice: Choice, simulation: Simulation | None
) -> dict[str, FrictionElements]:
    """Friction of the laws by part; empty without tests with cycles."""
    if not any(one.cyclic for one in tests):
        return {}
    if simulation is not None:
        raise ValueError(
            "tests with cycles are fitted by closed forms: omit --cycles or --simulate"
        )
    if choice.tension == "crimp-interchange":
        raise ValueError(
            "a law of both fibre strains has no friction: use another tension law, or "
            "omit --cycles"
        )
    return friction_of(tests, choice.up_to)


def _within_range(tests: Sequence[Test], up_to: float | None) -> list[Test]:
    """Tests in tension with one slack, and shear tests with one range, for all laws.

    By the law crimp-toe, and the polynomial of degree 5.
    """
    pulls = in_tension(_with_slack_of_a_toe(tests))
    shear = of_kind(tests, Specimen)
    if any(one.assumes_slack for one in shear):
        with suppress(ValueError):  # too few points for this law
            return [*fit_near(shear, Choice(up_to=up_to)).tests, *pulls]
    return [*shear, *pulls]


def _unphysical(result: FabricFit) -> dict[str, str]:
    """Reasons, by part, why a law decreases, or has a pole, within its data.

    Crimp interchange has a convex energy without a pole, whatever its parameters.
    """
    found, assumptions = {}, (result.tests, _with_fitted_slack(result))
    for part, of_part in result.parts.items():
        if part == "both" or of_part.model.name == "bending":
            continue
        up_to = result.choice.up_to
        largest = min(largest_argument(tests, part, up_to) for tests in assumptions)
        if reason := reason_against(of_part, largest):
            found[part] = reason
    return found


def _refuse_unphysical(result: FabricFit, reasons: Mapping[str, str]) -> None:
    """An error if there is a reason against a law."""
    for part, reason in reasons.items():
        notes = [
            note
            for one in result.specimens
            for note in beginning_notes(one, result.choice.up_to)
        ]
        advice = "use another law, such as auto, a lower degree, or bounds"
        raise ValueError(
            f"the fitted law {result.parts[part].model.name} of the {part} is not "
            "physical: "
            f"{reason}: {(notes or [advice])[0]}"
        )


def fit_near(
    tests: Sequence[Test],
    choice: Choice,
    simulations: Mapping[ShearTest, SimulatedTest] | None = None,
    start: ndarray | None = None,
    keep_zeros: bool = False,
) -> FabricFit:
    """Fit with given simulations of some tests, by laws near the fitted ones.

    An unknown slack determines which points are within the range: the fit is repeated
    with the fitted slack until the range is its own.

    Parameters
    ----------
    tests, choice
        See `fit_tests`.
    simulations
        Simulations by test.
    start
        Initial parameters; required if tension laws are fitted with simulations.
    keep_zeros
        See `fit`.
    """
    simulations, ranges = simulations or {}, list[FabricFit]()
    if choice.tension == "tabulated":
        tests = _with_slack_of_a_toe(tests)
    while True:
        result = _fit_within(tests, choice, simulations, start, keep_zeros)
        ranges.append(result)
        tests = _with_fitted_slack(result)
        known = any(_same_range(tests, one) for one in ranges)
        if known or len(ranges) == _MOST_ROUNDS:
            return result


def _fit_within(
    tests: Sequence[Test],
    choice: Choice,
    simulations: Mapping[ShearTest, SimulatedTest],
    start: ndarray | None,
    keep_zeros: bool = False,
) -> FabricFit:
    """Fit to the points within the range by the assumed slacks."""
    of_models = models_of(tests, choice)
    tensions = tuple(name for name in (*FAMILIES, "both") if name in of_models)
    samples = residuals.samples_of(tests, choice, simulations, tensions)
    result = fit(of_models, samples, start=start, keep_zeros=keep_zeros)
    return FabricFit(result, tuple(tests), choice, simulations)


def _with_fitted_slack(result: FabricFit) -> list[Test]:
    """Tests with the fitted slack instead of the assumed one."""
    return [one.with_slack(result.zeros_of(one)) for one in result.tests]


def _with_slack_of_a_toe(tests: Sequence[Test]) -> list[Test]:
    """Tests, with unknown slacks estimated by a crimp-toe fit."""
    pulls = in_tension(tests)
    if not any(x.slack_is_unknown and x.assumed_slack is None for x in pulls):
        return list(tests)
    try:
        found = iter(_with_fitted_slack(_fit_within(pulls, Choice(), {}, None)))
    except ValueError:  # too few points for this law
        return list(tests)
    return [next(found) if one in pulls else one for one in tests]


def _same_range(tests: Sequence[Test], result: FabricFit) -> bool:
    """True if tests and a fit have the same used points and ranges of laws."""
    up_to = result.choice.up_to
    pairs = zip(of_kind(tests, Specimen), result.specimens, strict=True)
    if any(np.any(a.used(up_to) != b.used(up_to)) for a, b in pairs):
        return False
    ends = [
        [largest_argument(each, part, up_to) for each in (tests, result.tests)]
        for part, law in result.laws.items()
        if part in ("shear", *FAMILIES) and np.isfinite(domain_of(law)[1])
    ]
    return all(abs(after - before) <= _EQUAL * before for after, before in ends)


def _fitted_by_simulation(
    tests: Sequence[Test], choice: Choice, simulation: Simulation
) -> FabricFit:
    """Fit such that simulated bias extensions have the measured loads."""
    tests = [_driven(one) if _is_bias(one) else one for one in tests]
    result = fit_near(tests, choice)
    specimens = [one for one in result.specimens if _is_bias(one)]
    largest = [reach(one, choice.up_to) for one in specimens]
    before = _loads(result)
    for n in range(_MOST_ROUNDS):
        found = simulated(
            simulation, result.laws, [one.test for one in specimens], largest
        )
        start = result.fit.joint.values
        result = fit_near(result.tests, choice, found, start)
        loads = _loads(result)
        change = max(map(_change, before, loads))
        log.info(
            "simulation %d: loads change by at most %.3g times the largest load",
            n + 1,
            change,
        )
        if n and change < _SETTLED:
            return result
        before = loads
    raise ValueError(
        f"after {_MOST_ROUNDS} simulations the loads still change by {change:.2%}: "
        "use a law with fewer parameters, or a smaller angle --up-to"
    )


def _is_bias(test: Test) -> bool:
    return isinstance(test, Specimen) and isinstance(test.test, BiasExtension)


def _driven(specimen: Any) -> Specimen:
    """A bias extension that is simulated: its displacement is imposed.

    The range has no limit, except for a measured departure from the theoretical angle.
    """
    if specimen.displacement is None:
        raise ValueError(
            f"{specimen.name}: only bias-extension tests with displacements can be "
            "fitted by simulation"
        )
    return replace(specimen, measured_angle=None, range_end=specimen.departure)


def _change(before: ndarray, after: ndarray) -> float:
    """Largest change of loads, relative to the largest; infinite for another range."""
    if before.size != after.size:
        return np.inf
    return float(np.abs(after - before).max() / np.abs(after).max())


def _loads(result: FabricFit) -> list[Any]:
    """Predicted loads of each curve."""
    joint = result.fit.joint
    return [joint.predicted(i) for i in range(len(joint.samples))]
