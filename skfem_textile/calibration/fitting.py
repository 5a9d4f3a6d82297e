"""Laws of a fabric from tests of one or several kinds, in one least-squares problem."""

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy import ndarray

from ..fabric import Fabric
from ..scenes.shear_test import BiasExtension, ShearTest
from . import models, residuals
from .bending import CantileverTest
from .biaxial import FAMILIES, BiaxialCurve
from .models import Model
from .regression import Fit, JointFit, fit
from .simulation import SimulatedTest, Simulation, simulated
from .solving import PARTS, Sample
from .specimens import ROUNDING, Specimen
from .strip import Strip

log = logging.getLogger(__name__)

#: A test of any kind.
Test: TypeAlias = Specimen | Strip | BiaxialCurve | CantileverTest

#: Shear laws by name, as functions of the largest angle, the degree, and the number of
#: points.
SHEAR_LAWS: dict[str, Callable[[float, int, int], Model]] = {
    "polynomial": lambda largest, degree, points: models.polynomial(degree),
    "linear": lambda largest, degree, points: models.linear(),
    "sin2": lambda largest, degree, points: models.sin2(),
    "locking": lambda largest, degree, points: models.locking(largest),
    "tabulated": lambda largest, degree, points: models.tabulated(largest, points),
}

#: Tension laws by name, as functions of the largest strain and the number of points.
TENSION_LAWS: dict[str, Callable[[float, int], Model]] = {
    "crimp-toe": lambda largest, points: models.crimp_toe(largest),
    "linear": lambda largest, points: models.linear(),
    "tabulated": models.tabulated,
    "crimp-interchange": lambda largest, points: models.crimp_interchange(largest),
}

_Kind = TypeVar("_Kind")


@dataclass(frozen=True)
class Choice:
    """Laws that are fitted, and the range of the data.

    Parameters
    ----------
    shear
        Shear law: ``polynomial`` (odd powers), ``linear``, ``sin2``, ``locking`` or
        ``tabulated``.
    tension
        Tension law of each family, ``crimp-toe``, ``linear`` or ``tabulated``; or
        ``crimp-interchange``, whose tensions depend on both strains.
    degree
        Highest power of the polynomial.
    points
        Number of points of a table besides 0.
    extrapolation
        Extrapolation of a table, ``refuse`` or ``linear``, see `Tabulated`.
    up_to
        Shear angle in radians above which points are excluded; see `Specimen.used`.
    bounds
        Smallest and largest value of parameters, by name, such as ``c1`` or ``warp
        stiffness``.

    Raises
    ------
    ValueError
        If a law is unknown, or a number is not positive.
    """

    shear: str = "polynomial"
    tension: str = "crimp-toe"
    degree: int = 5
    points: int = 8
    extrapolation: str | None = None
    up_to: float | None = None
    bounds: Mapping[str, tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        for law, laws in ((self.shear, SHEAR_LAWS), (self.tension, TENSION_LAWS)):
            if law not in laws:
                raise ValueError(
                    f"unknown law {law!r}: choose one of {', '.join(laws)}"
                )
        if self.up_to is not None and not self.up_to > 0:
            raise ValueError(
                "the largest shear angle must be positive, got "
                f"{np.degrees(self.up_to):g} degrees"
            )
        if self.points < 1:
            raise ValueError(
                f"a table requires at least one point besides 0, got {self.points}"
            )


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
    """

    fit: JointFit
    tests: tuple[Test, ...]
    choice: Choice
    simulations: Mapping[ShearTest, SimulatedTest]

    @property
    def parts(self) -> dict[str, Fit]:
        """Fit of each law by part, see `PARTS`."""
        return self.fit.parts

    @property
    def laws(self) -> dict[str, Any]:
        """Laws by part."""
        return self.fit.joint.law

    def fabric(self, base: Fabric) -> Fabric:
        """A fabric whose laws are replaced by the fitted ones."""
        laws, (warp, weft) = self.laws, base.bending
        tension: Any = base.tension
        if "both" in laws:
            tension = laws["both"]
        elif {*FAMILIES} & set(laws):
            tension = tuple(laws.get(f.name, f.tension) for f in base.families)
        bending = (
            laws["bending warp"].stiffness if "bending warp" in laws else warp,
            laws["bending weft"].stiffness if "bending weft" in laws else weft,
        )
        shear = laws.get("shear", base.shear)
        return replace(base, tension=tension, shear=shear, bending=bending)

    @cached_property
    def specimens(self) -> tuple[Specimen, ...]:
        """Shear tests, in the order of the curves of the part ``shear``."""
        return tuple(_of_kind(self.tests, Specimen))

    def along(self, part: str) -> list[tuple[Strip | BiaxialCurve, list[int]]]:
        """Tests of a tension law and their families, in the order of its curves."""
        families = [i for i, name in enumerate(FAMILIES) if part in (name, "both")]
        curves: list[Strip | BiaxialCurve] = [*_of_kind(self.tests, BiaxialCurve)]
        curves += [one for one in _of_kind(self.tests, Strip) if one.family == part]
        return [(one, families) for one in curves]

    def cantilevers(self, part: str) -> list[CantileverTest]:
        """Tests of a bending stiffness, in the order of its curves."""
        tests = _of_kind(self.tests, CantileverTest)
        return [one for one in tests if part == f"bending {one.family}"]

    @property
    def largest_angle(self) -> float:
        """Largest fitted shear angle in radians."""
        return max(_reach(s, self.choice.up_to) for s in self.specimens)

    @property
    def stabilisation(self) -> float | None:
        """Largest energy share of the stabilisation; None without simulations."""
        shares = [one.stabilisation for one in self.simulations.values()]
        return max(shares, default=None)


# Convergence of the loads: relative change.  Chosen: a tenth of the uncertainty of a
# load from a curve with a noise of 1 %.
_SETTLED = 1e-3

# Maximum number of simulations of each test; four are usual.
_MOST_ROUNDS = 10


def fit_tests(
    tests: Sequence[Test],
    choice: Choice | None = None,
    simulation: Simulation | None = None,
) -> FabricFit:
    """Fit the laws of a fabric to tests of one or several kinds.

    All tests enter one least-squares problem, each weighted by its noise.  Each kind of
    test determines some laws: shear tests the shear law, strips the tension law of one
    family, biaxial tests both, cantilevers a bending stiffness.

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
        If there is no test; if a specimen has no points in the range, angles that its
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
    bias = [one for one in _of_kind(tests, Specimen) if _is_bias(one)]
    if simulation is None or not bias:
        if simulation is not None:
            raise ValueError(
                "only bias-extension tests are simulated: omit the simulation"
            )
        return _fitted(tests, choice)
    return _fitted_by_simulation(tests, choice, simulation)


def _fitted(
    tests: Sequence[Test],
    choice: Choice,
    simulations: Mapping[ShearTest, SimulatedTest] | None = None,
    start: Any = None,
) -> FabricFit:
    """Fit with given simulations of some tests."""
    of_models, simulations = _models(tests, choice), simulations or {}
    samples: list[Sample] = []
    coupled = bool({*FAMILIES, "both"} & set(of_models))
    specimens = _of_kind(tests, Specimen)
    largest = max((_reach(one, choice.up_to) for one in specimens), default=0.0)
    curves = _of_kind(tests, BiaxialCurve)
    if "both" in of_models:
        samples += [residuals.biaxial_coupled(one) for one in curves]
    else:
        samples += [residuals.biaxial(c, i) for i in range(2) for c in curves]
    samples += [residuals.strip(one) for one in _of_kind(tests, Strip)]
    for one in specimens:
        found = simulations.get(one.test)
        end = np.inf if found and choice.up_to is None else choice.up_to
        both = coupled and found is not None
        samples.append(residuals.shear(one, end, largest, found, both))
    samples += [residuals.cantilever(one) for one in _of_kind(tests, CantileverTest)]
    result = fit(of_models, samples, start=start)
    return FabricFit(result, tuple(tests), choice, simulations)


def _fitted_by_simulation(
    tests: Sequence[Test], choice: Choice, simulation: Simulation
) -> FabricFit:
    """Fit such that simulated bias extensions have the measured loads."""
    tests = [_driven(one) if _is_bias(one) else one for one in tests]
    specimens = [one for one in _of_kind(tests, Specimen) if _is_bias(one)]
    end = choice.up_to or np.inf
    largest = [_reach(one, end) for one in specimens]
    result = _fitted(tests, replace(choice, up_to=end))
    before = _loads(result)
    for n in range(_MOST_ROUNDS):
        found = simulated(
            simulation, result.laws, [one.test for one in specimens], largest
        )
        start = result.fit.joint.values
        result = _fitted(tests, replace(choice, up_to=end), found, start)
        loads = _loads(result)
        change = max(
            float(np.abs(current - previous).max() / np.abs(current).max())
            for current, previous in zip(loads, before, strict=True)
        )
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


def _of_kind(tests: Iterable[Test], kind: type[_Kind]) -> list[_Kind]:
    return [one for one in tests if isinstance(one, kind)]


def _is_bias(test: Test) -> bool:
    return isinstance(test, Specimen) and isinstance(test.test, BiasExtension)


def _driven(specimen: Any) -> Specimen:
    """A bias extension that is simulated: its displacement is imposed."""
    if specimen.displacement is None:
        raise ValueError(
            f"{specimen.name}: only bias-extension tests with displacements can be "
            "fitted by simulation"
        )
    return replace(specimen, measured_angle=None)


def _loads(result: FabricFit) -> list[Any]:
    """Predicted loads of each curve."""
    joint = result.fit.joint
    return [joint.predicted(i) for i in range(len(joint.samples))]


def _models(tests: Sequence[Test], choice: Choice) -> dict[str, Model]:
    """Laws that the tests determine, by part."""
    found: dict[str, Model] = {}
    curves, strips = _of_kind(tests, BiaxialCurve), _of_kind(tests, Strip)
    coupled = choice.tension == "crimp-interchange"
    if coupled and strips:
        raise ValueError(
            f"{strips[0].name}: a strip determines a tension that depends on one "
            "strain: use biaxial tests alone for crimp-interchange, or another law"
        )
    names = ["both"] if coupled else list(FAMILIES)
    for name in names:
        loaded = [one for one in strips if one.family == name]
        own: list[Strip | BiaxialCurve] = [*curves, *loaded]
        if own:
            largest = _largest_strain(own, name)
            found[name] = TENSION_LAWS[choice.tension](largest, choice.points)
    specimens = _of_kind(tests, Specimen)
    if specimens:
        for one in specimens:
            _refuse_specimen(one, choice.up_to)
        largest = max(_reach(one, choice.up_to) for one in specimens)
        of_law = SHEAR_LAWS[choice.shear]
        found["shear"] = of_law(largest, choice.degree, choice.points)
    for test in _of_kind(tests, CantileverTest):
        found[f"bending {test.family}"] = models.bending()
    ordered = {name: found[name] for name in PARTS if name in found}
    return _extrapolated(_bounded(ordered, choice.bounds or {}), choice.extrapolation)


def _extrapolated(
    found: Mapping[str, Model], extrapolation: str | None
) -> dict[str, Model]:
    """Models whose tables are extrapolated; an error if there is none."""
    if extrapolation is None:
        return dict(found)
    if not any(model.name == "tabulated" for model in found.values()):
        raise ValueError(
            f"the law {next(iter(found.values())).name} is defined beyond the data by "
            "its formula: omit the extrapolation, or use the law tabulated"
        )
    return {
        name: model.extrapolated(extrapolation) if model.name == "tabulated" else model
        for name, model in found.items()
    }


def _bounded(
    found: Mapping[str, Model], bounds: Mapping[str, tuple[float, float]]
) -> dict[str, Model]:
    """Models with the bounds of their parameters."""
    known = {
        given
        for part, model in found.items()
        for name in model.parameters
        for given in (name, f"{part} {name}")
    }
    laws = [model for part, model in found.items() if not part.startswith("bending")]
    for name in bounds:
        if name not in known:
            of = " or ".join(dict.fromkeys(model.name for model in laws))
            names = dict.fromkeys(p for model in laws for p in model.parameters)
            raise ValueError(
                f"the law {of} has no parameter {name!r}: choose one of "
                f"{', '.join(names)}"
            )
    return {
        part: model.bounded(
            {
                name.removeprefix(f"{part} "): ends
                for name, ends in bounds.items()
                if name.removeprefix(f"{part} ") in model.parameters
            }
        )
        for part, model in found.items()
    }


def _largest_strain(tests: Sequence[Strip | BiaxialCurve], part: str) -> float:
    """Largest strain of the families of a part; an error without strain or force."""
    families = [i for i, name in enumerate(FAMILIES) if part in (name, "both")]
    along = {i: [x for t in tests if (x := t.along(i))] for i in families}
    largest = max(float(x.strain.max()) for each in along.values() for x in each)
    if not largest > 0:
        names = " or ".join(FAMILIES[i] for i in families)
        raise ValueError(f"no test contains a positive strain of the {names}")
    for i, each in along.items():
        if not sum(float(x.force.sum()) for x in each) > 0:
            raise ValueError(
                f"the forces along the {FAMILIES[i]} must be positive in tension: "
                "reverse the sign of the column"
            )
    return largest


def _reach(specimen: Specimen, up_to: float | None) -> float:
    """Largest fitted shear angle of a specimen in radians."""
    return float(specimen.angle[specimen.used(up_to)].max())


def _refuse_specimen(specimen: Specimen, up_to: float | None) -> None:
    """An error if angles or forces of a specimen cannot be fitted."""
    used = specimen.used(up_to)
    _refuse_angles(specimen, used, up_to)
    _refuse_forces(specimen, used)


def _refuse_angles(specimen: Specimen, used: ndarray, up_to: float | None) -> None:
    name, end = specimen.name, np.degrees(specimen.test.largest_angle)
    angles = np.degrees(specimen.angle[np.isfinite(specimen.angle)])
    if specimen.measured_angle is not None and np.any(angles > end * (1 + ROUNDING)):
        raise ValueError(
            f"{name}: shear angles reach {angles.max():.4g} degrees, but the test ends "
            f"at {end:.4g} degrees: check their unit"
        )
    if np.any(used & (specimen.angle > 0)):
        return
    last = np.degrees(specimen.last_angle(up_to))
    message = (
        f"the angles range from {angles.min():.3g} to {angles.max():.3g} degrees"
        if angles.size
        else "all displacements are beyond the end of the test: check their unit"
    )
    raise ValueError(
        f"{name}: no shear angle is between 0 and {last:.3g} degrees: {message}"
    )


def _refuse_forces(specimen: Specimen, used: ndarray) -> None:
    force = specimen.force[used]
    if force.size > 1 and np.ptp(force) == 0:
        raise ValueError(
            f"{specimen.name}: the force is {force[0]:g} N at every point, but it must "
            "change with the shear angle"
        )
    if not force.sum() > 0:
        raise ValueError(
            f"{specimen.name}: the forces must be positive in tension: reverse the "
            "sign of the column"
        )
