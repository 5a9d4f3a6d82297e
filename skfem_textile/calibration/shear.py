"""Shear law from picture-frame or bias-extension tests of several specimens.

Beyond the range of their kinematics bias extensions are simulated.  The ratio of the
simulated load to the closed form, which accounts for fibre stretch and all other
effects that the closed form neglects, depends only weakly on the law: the closed form
times this ratio is fitted, and the simulation is repeated with the resulting law until
the loads converge.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..fabric import Fabric, Law, Tabulated
from ..fabric.law import domain_of
from ..ply import Ply
from ..scenes.bias_extension import bias_extension
from ..scenes.rectangle import rectangle
from ..scenes.shear_test import BiasExtension, ShearTest
from ..solve.result import StepError
from ..solve.stepper import LoadStepper
from . import models
from .models import Model
from .regression import Fit, fit
from .solving import Offset, Sample
from .specimens import ROUNDING, Specimen, slack_range

log = logging.getLogger(__name__)

#: Shear laws by name, as functions of the largest angle, the degree, and the number of
#: points.
SHEAR_LAWS: dict[str, Callable[[float, int, int], Model]] = {
    "polynomial": lambda largest, degree, points: models.polynomial(degree),
    "linear": lambda largest, degree, points: models.linear(),
    "sin2": lambda largest, degree, points: models.sin2(),
    "locking": lambda largest, degree, points: models.locking(largest),
    "tabulated": lambda largest, degree, points: models.tabulated(largest, points),
}


@dataclass(frozen=True, eq=False)
class ShearFit:
    """Shear law fitted to specimens.

    Attributes
    ----------
    fit
        Parameters and their confidence.
    specimens
        The curves.
    up_to
        Requested limit of the shear angle in radians, if given.
    stabilisation
        Largest energy share of the stabilisation in the simulations; None without
        simulations.
    """

    fit: Fit
    specimens: tuple[Specimen, ...]
    up_to: float | None
    stabilisation: float | None = None

    @property
    def simulated(self) -> bool:
        """True if loads of simulations were compared, not of closed forms."""
        return self.stabilisation is not None

    @property
    def largest_angle(self) -> float:
        """Largest fitted shear angle in radians."""
        return max(float(s.angle[s.used(self.up_to)].max()) for s in self.specimens)


def fit_shear(
    specimens: Sequence[Specimen],
    law: str = "polynomial",
    *,
    degree: int = 5,
    points: int = 8,
    extrapolation: str | None = None,
    up_to: float | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    ratios: Sequence[Callable[[ndarray], ndarray]] | None = None,
) -> ShearFit:
    """Fit a shear law to specimens, by the forces for inextensible fibres.

    Parameters
    ----------
    specimens
        The curves.
    law
        ``polynomial`` (odd powers), ``linear``, ``sin2``, ``locking`` or ``tabulated``.
    degree
        Highest power of the polynomial.
    points
        Number of points of the table besides 0.
    extrapolation
        Extrapolation of the table, ``refuse`` or ``linear``, see `Tabulated`.
    up_to
        Shear angle in radians above which points are excluded; see `Specimen.used`.
    bounds
        Smallest and largest value of parameters, by name.
    ratios
        Ratio of the force of each specimen to the closed form at shear angles.

    Raises
    ------
    ValueError
        If the law is unknown, or is not tabulated but has an extrapolation; if a
        specimen has no points in the range, angles that its test does not reach, or
        forces that are compressive or constant; or see `regression.fit`.

    Examples
    --------
    >>> from skfem_textile.calibration import BiasExtension, Specimen, fit_shear
    >>> from skfem_textile import Sin2
    >>> test, gamma = BiasExtension(100.0, 250.0), np.radians(np.arange(1.0, 40.0))
    >>> force = test.force(Sin2(0.3), gamma)
    >>> specimen = Specimen("one", test, force, displacement=test.displacement(gamma))
    >>> fit_shear([specimen], "sin2").fit.law.stiffness.__round__(9)
    0.3
    """
    if law not in SHEAR_LAWS:
        raise ValueError(f"unknown law {law!r}: choose one of {', '.join(SHEAR_LAWS)}")
    if up_to is not None and not up_to > 0:
        raise ValueError(
            f"the largest shear angle must be positive, got {np.degrees(up_to):g} "
            "degrees"
        )
    if points < 1:
        raise ValueError(f"a table requires at least one point besides 0, got {points}")
    for specimen in specimens:
        _refuse_angles(specimen, specimen.used(up_to), up_to)
    angles = [float(s.angle[s.used(up_to)].max()) for s in specimens]
    largest = max(angles, default=0.0)
    samples = [
        _sample(specimen, up_to, largest, None if ratios is None else ratios[i])
        for i, specimen in enumerate(specimens)
    ]
    model = SHEAR_LAWS[law](largest, degree, points).bounded(bounds or {})
    result = fit(model.extrapolated(extrapolation), samples)
    return ShearFit(result, tuple(specimens), up_to)


def _sample(
    specimen: Specimen,
    up_to: float | None,
    largest: float,
    ratio: Callable[[ndarray], ndarray] | None,
) -> Sample:
    """Fitted points of a specimen, and the forces of a law there.

    The zeros of a machine that are unknown are the arguments of a prediction after the
    law: the force at rest, then the slack.
    """
    used = specimen.used(up_to)
    _refuse_forces(specimen, used)
    moved, zeros = specimen.displacement, specimen.zeros
    at_rest, most = zeros.force, float(np.abs(specimen.force[used]).max())
    offsets = []
    if at_rest is None:
        offsets.append(Offset("force at rest", "N", 0.0, -most, most, False))
    slides = moved is not None and specimen.measured_angle is None
    if slides and zeros.slack is None:
        assert moved is not None
        low, high = slack_range(moved)
        start = float(np.clip(specimen.slack, low, high))
        offsets.append(Offset("slack", "mm", start, low, high, True))
    known = specimen.angle[used]

    def predict(law: Law, *unknown: float) -> ndarray:
        values = dict(zip((o.name for o in offsets), unknown, strict=bool(unknown)))
        gamma = known
        if "slack" in values:
            assert moved is not None
            gamma = specimen.angle_at(moved[used], values["slack"])
            # ends before a pole, or the end of a table, and the last angle of the test
            bounded = np.isfinite(domain_of(law)[1])
            gamma = np.fmin(gamma, largest if bounded else specimen.last_angle(np.inf))
        force = specimen.test.force(law, gamma)
        if ratio is not None:
            force = ratio(gamma) * force
        return force + values.get("force at rest", at_rest or 0.0)

    return Sample(specimen.name, specimen.force[used], predict, tuple(offsets))


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


# Convergence of the loads: relative change.  Chosen: a tenth of the uncertainty of a
# load from a curve with a noise of 1 %.
_SETTLED = 1e-3

# Maximum number of simulations of each test; four are usual.
_MOST_ROUNDS = 10


class Simulated(NamedTuple):
    """Theoretical shear angles and forces of a simulated test, from 0 on, shape (n,).

    ``stabilisation`` is its largest share of the energy.
    """

    angles: ndarray
    forces: ndarray
    stabilisation: float


@dataclass(frozen=True)
class Simulation:
    """Settings of simulated tests.

    Parameters
    ----------
    tension
        Fibre stiffness in N/mm or tension law, see `Fabric`.
    across
        Number of element edges across the width.
    steps
        Number of load steps, equal in the shear angle.
    seed
        Seed of the irregular mesh.
    """

    tension: Any = 1e5
    across: int = 12
    steps: int = 12
    seed: int = 1

    def __post_init__(self) -> None:
        if self.across < 2 or self.across % 2:
            raise ValueError(
                "the number of elements across must be even and at least 2, got "
                f"{self.across}"
            )

    def curve(self, law: Law, test: BiasExtension, largest: float) -> Simulated:
        """Curve of a shear law from 0 up to a theoretical shear angle in radians.

        Raises
        ------
        ValueError
            If the simulation does not reach the angle.
        """
        W, H, theta = test.width, test.height, test.inclination
        fibres = theta, np.pi - theta
        nx = self.across // 2  # elements are split into four
        size = nx, max(round(nx * H / W), 2)
        mesh = rectangle(W, H, size, "irregular", 0.25, self.seed, *fibres)
        warp, weft = fibres
        scene = bias_extension(mesh, warp=warp, weft=weft, shear_angle=largest)
        fabric = Fabric(self.tension, law, scene.warp, scene.weft)
        stepper = LoadStepper(Ply(mesh, fabric), scene.conditions, self.steps)
        try:
            states = stepper.run().states
        except StepError as error:
            raise ValueError(f"the simulation of the test failed: {error}") from None
        angles = np.array([state.load_factor for state in states]) * largest
        forces = np.array([scene.reaction(state)[1] for state in states])
        shares = [state.shares["energy"]["stabilisation"] for state in states[1:]]
        return Simulated(angles, forces, max(shares))


def fit_by_simulation(
    specimens: Sequence[Specimen],
    law: str = "polynomial",
    simulation: Simulation | None = None,
    *,
    degree: int = 5,
    points: int = 8,
    extrapolation: str | None = None,
    up_to: float | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> ShearFit:
    """Fit a shear law such that simulated bias extensions have the measured loads.

    Parameters
    ----------
    specimens
        Curves of bias extensions, with displacements.
    law, degree, points, extrapolation, bounds
        See `fit_shear`.
    simulation
        Settings of the simulations.
    up_to
        Theoretical shear angle in radians at the displacement above which points are
        excluded; by default all points are used.

    Raises
    ------
    ValueError
        See `fit_shear`; if a specimen is not a bias extension or has no displacements;
        or if a simulation fails, or the laws do not converge.
    """
    simulation = simulation or Simulation()
    for specimen in specimens:
        bias = isinstance(specimen.test, BiasExtension)
        if not bias or specimen.displacement is None:
            raise ValueError(
                f"{specimen.name}: only bias-extension tests with displacements can be "
                "fitted by simulation"
            )
    driven = [replace(specimen, measured_angle=None) for specimen in specimens]
    end = np.inf if up_to is None else up_to
    how: dict[str, Any] = {"degree": degree, "points": points, "bounds": bounds}
    how["extrapolation"] = extrapolation
    result = fit_shear(driven, law, up_to=end, **how)
    largest = [float(s.angle[s.used(end)].max()) for s in driven]
    before = [np.full(1, np.inf) for _ in driven]
    for n in range(_MOST_ROUNDS):
        law_now = result.fit.law
        curves = _simulated(simulation, law_now, driven, largest)
        ratios = [_ratio(s.test, law_now, curves[s.test]) for s in driven]
        result = fit_shear(driven, law, up_to=end, **how, ratios=ratios)
        loads = [result.fit.predicted(i) for i in range(len(driven))]
        change = max(
            float(np.abs(current - previous).max() / np.abs(current).max())
            for current, previous in zip(loads, before, strict=True)
        )
        log.info(
            "simulation %d: loads change by at most %.3g times the largest load",
            n + 1,
            change,
        )
        if change < _SETTLED:
            shares = (curve.stabilisation for curve in curves.values())
            return replace(result, stabilisation=max(shares))
        before = loads
    raise ValueError(
        f"after {_MOST_ROUNDS} simulations the loads still change by {change:.2%}: "
        "use a law with fewer parameters, or a smaller angle --up-to"
    )


def _simulated(
    simulation: Simulation,
    law: Law,
    specimens: Sequence[Specimen],
    largest: Sequence[float],
) -> dict[Any, Simulated]:
    """Curve of each test; specimens of one size share a simulation."""
    if isinstance(law, Tabulated):  # some elements shear more than the middle
        law = replace(law, extrapolation="linear")
    ends: dict[Any, float] = {}
    for specimen, end in zip(specimens, largest, strict=True):
        ends[specimen.test] = max(end, ends.get(specimen.test, 0.0))
    return {test: simulation.curve(law, test, end) for test, end in ends.items()}


def _ratio(test: ShearTest, law: Law, curve: Simulated) -> Callable[[ndarray], ndarray]:
    """Ratio of the simulated load to the closed form."""
    from scipy.interpolate import PchipInterpolator  # imported only if needed

    ratio = curve.forces[1:] / test.force(law, curve.angles[1:])
    return PchipInterpolator(curve.angles, np.concatenate([ratio[:1], ratio]))
