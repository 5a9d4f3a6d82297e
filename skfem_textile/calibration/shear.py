"""Shear law from picture-frame or bias-extension tests of several specimens.

Beyond the range of their kinematics bias extensions are simulated.  The ratio of the
simulated load to the closed form, which accounts for fibre stretch and all other
effects that the closed form neglects, depends only weakly on the law: the closed form
times this ratio is fitted, and the simulation is repeated with the resulting law until
the loads converge.
"""

import logging
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..fabric import Fabric, Law, Tabulated
from ..ply import Ply
from ..scenes.bias_extension import bias_extension
from ..scenes.rectangle import rectangle
from ..scenes.shear_test import BiasExtension, ShearTest
from ..solve.result import StepError
from ..solve.stepper import LoadStepper
from . import regression as models
from .curves import read_test
from .regression import Fit, Model, Sample, fit

log = logging.getLogger(__name__)

#: Shear angle in radians up to which the theoretical one is reliable.  Cao et al.
#: (2008) find that it fails beyond 30 to 45 degrees.
BELIEVED = float(np.radians(40.0))

#: Difference in radians of measured and theoretical angle above which there is slip.
APART = float(np.radians(2.0))

# Rounding tolerance of the end of the range.
_ROUNDING = 1e-9

# Decrease of the displacement, relative to its range, that indicates unloading.
# Chosen: far above the noise of a machine.
_BACK = 0.1

# Share of the largest angle of a test above which points are excluded: forces of the
# closed form are unbounded there.
_END = 0.999

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
class Specimen:
    """Curve of one specimen.

    Attributes
    ----------
    name
        Name of the specimen.
    test
        Kind of test and its dimensions.
    force
        Force in N, shape (n,).
    displacement, measured_angle
        Displacement in mm, and shear angle in radians, shape (n,); one of them may be
        missing.
    """

    name: str
    test: ShearTest
    force: ndarray
    displacement: ndarray | None = None
    measured_angle: ndarray | None = None

    @cached_property
    def theoretical_angle(self) -> ndarray | None:
        """Shear angle for inextensible fibres without slip; nan beyond the end."""
        if self.displacement is None:
            return None
        return self.test.shear_angle(self.displacement)

    @cached_property
    def angle(self) -> ndarray:
        """Measured shear angle, or the theoretical one, in radians."""
        if self.measured_angle is not None:
            return self.measured_angle
        assert self.theoretical_angle is not None
        return self.theoretical_angle

    @cached_property
    def kinematics_limit(self) -> float:
        """Shear angle in radians up to which the kinematics of the test are valid.

        Up to the angle at which the measured one differs from the theoretical one, or
        `BELIEVED` if one of the two is missing.
        """
        if self.measured_angle is None or self.theoretical_angle is None:
            return min(BELIEVED, self.test.largest_angle)
        order = np.argsort(self.measured_angle)
        measured = self.measured_angle[order]
        off = np.abs(measured - self.theoretical_angle[order])
        deviating = np.flatnonzero(~(off <= APART))
        last = deviating[0] - 1 if deviating.size else measured.size - 1
        return float(measured[last]) if last >= 0 else 0.0

    def last_angle(self, up_to: float | None) -> float:
        """Shear angle in radians up to which points are fitted.

        The requested angle; by default `BELIEVED`, or unlimited if the angle is
        measured; at most the end of the motion of the test.
        """
        if up_to is None:
            up_to = np.inf if self.measured_angle is not None else BELIEVED
        return min(up_to * (1 + _ROUNDING), _END * self.test.largest_angle)

    def used(self, up_to: float | None) -> ndarray:
        """Mask of the fitted points: from 0 to `last_angle`, shape (n,)."""
        with np.errstate(invalid="ignore"):
            return (self.angle >= 0) & (self.angle <= self.last_angle(up_to))

    @property
    def driven(self) -> ndarray:
        """Displacements, which drive the test, or angles if there are none."""
        return self.angle if self.displacement is None else self.displacement

    def ways(self, up_to: float | None) -> tuple[bool, bool]:
        """Loading and unloading beyond noise, within the fitted points."""
        driven = self.driven[self.used(up_to)]
        forth, back = (
            bool(np.any(np.maximum.accumulate(x) - x > _BACK * np.ptp(driven)))
            for x in (driven[::-1], driven)
        )
        return forth, back

    def pointwise(self, up_to: float | None) -> tuple[ndarray, ndarray]:
        """Increasing shear angles, and C by pointwise data reduction."""
        used = self.used(up_to) & (self.angle > 0)
        order = np.argsort(self.angle[used], kind="stable")
        gamma, force = self.angle[used][order], self.force[used][order]
        moment = self.test.moment(gamma, force)
        known = np.isfinite(moment)
        return gamma[known], moment[known]


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


def read_specimen(
    path: str | os.PathLike[str],
    test: ShearTest,
    units: Mapping[str, str] | None = None,
) -> Specimen:
    """Specimen of a CSV file, see `read_curve`.

    It has a column ``force`` and one or both of ``displacement`` and ``shear angle``: a
    measured angle takes precedence over the theoretical one.

    Parameters
    ----------
    path
        The file.
    test
        Kind of test and its dimensions.
    units
        Units of columns for which the file contains none.

    Raises
    ------
    ValueError
        If the file is refused, or a column is missing.
    OSError
        If it cannot be read.
    """
    name, columns = read_test(path, units, "force")
    if "displacement" not in columns and "shear angle" not in columns:
        raise ValueError(
            f"{name}: a column 'displacement' or 'shear angle' is required"
        )
    moved, angle = columns.get("displacement"), columns.get("shear angle")
    return Specimen(name, test, columns["force"], moved, angle)


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
    samples = [
        _sample(specimen, up_to, None if ratios is None else ratios[i])
        for i, specimen in enumerate(specimens)
    ]
    angles = [float(s.angle[s.used(up_to)].max()) for s in specimens]
    largest = max(angles, default=0.0)
    model = SHEAR_LAWS[law](largest, degree, points).bounded(bounds or {})
    result = fit(model.extrapolated(extrapolation), samples)
    return ShearFit(result, tuple(specimens), up_to)


def _sample(
    specimen: Specimen, up_to: float | None, ratio: Callable[[ndarray], ndarray] | None
) -> Sample:
    """Fitted points of a specimen, and the forces of a law there."""
    used = specimen.used(up_to)
    _refuse_angles(specimen, used, up_to)
    _refuse_forces(specimen, used)
    gamma = specimen.angle[used]
    times = 1.0 if ratio is None else ratio(gamma)

    def predict(law: Law) -> ndarray:
        return times * specimen.test.force(law, gamma)

    return Sample(specimen.name, specimen.force[used], predict)


def _refuse_angles(specimen: Specimen, used: ndarray, up_to: float | None) -> None:
    name, end = specimen.name, np.degrees(specimen.test.largest_angle)
    angles = np.degrees(specimen.angle[np.isfinite(specimen.angle)])
    if specimen.measured_angle is not None and np.any(angles > end * (1 + _ROUNDING)):
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
        loads = [sample.predict(result.fit.law) for sample in result.fit.samples]
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
