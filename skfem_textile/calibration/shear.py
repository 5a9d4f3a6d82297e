"""A shear law from picture-frame or bias-extension tests of several specimens.

Beyond the range of their kinematics bias extensions are simulated.  The load of the
simulation over that of the closed form, which has fibre stretch and all that the closed
form leaves out in it, changes little with the law: the closed form times this ratio is
fitted, and the simulation repeated with the law that was found, until the loads no
longer change.
"""

import logging
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.interpolate import PchipInterpolator

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

#: Shear angle up to which the theoretical one is believed, in radians.  Cao et al.
#: (2008) find that it fails somewhere past 30 to 45 degrees.
BELIEVED = float(np.radians(40.0))

#: A measured angle that is further from the theoretical one shows slip, in radians.
APART = float(np.radians(2.0))

# A point at the end of the range is in it, whatever its rounding.
_ROUNDING = 1e-9

# Share of its range by which a displacement falls if the test turns back.  Chosen: far
# more than the noise of a machine.
_BACK = 0.1

# Share of the largest angle of a test beyond which points are left out: forces of the
# closed form have no bound there.
_END = 0.999

#: Shear laws by name, of the largest angle, the degree, and the number of points.
SHEAR_LAWS: dict[str, Callable[[float, int, int], Model]] = {
    "polynomial": lambda largest, degree, points: models.polynomial(degree),
    "linear": lambda largest, degree, points: models.linear(),
    "sin2": lambda largest, degree, points: models.sin2(),
    "locking": lambda largest, degree, points: models.locking(largest),
    "tabulated": lambda largest, degree, points: models.tabulated(largest, points),
}


@dataclass(frozen=True, eq=False)
class Specimen:
    """The curve of one specimen.

    Attributes
    ----------
    name
        What it is called.
    test
        The kind of test and its sizes.
    force
        In N, shape (n,).
    displacement, measured_angle
        In mm, and the shear angle in radians, shape (n,); one of them may be missing.
    """

    name: str
    test: ShearTest
    force: ndarray
    displacement: ndarray | None = None
    measured_angle: ndarray | None = None

    @cached_property
    def theoretical_angle(self) -> ndarray | None:
        """The shear angle of fibres that do not stretch or slip; nan past its end."""
        if self.displacement is None:
            return None
        return self.test.shear_angle(self.displacement)

    @cached_property
    def angle(self) -> ndarray:
        """The measured shear angle, or the theoretical one, in radians."""
        if self.measured_angle is not None:
            return self.measured_angle
        assert self.theoretical_angle is not None
        return self.theoretical_angle

    @cached_property
    def kinematics_hold_to(self) -> float:
        """Shear angle in radians up to which the kinematics of the test hold.

        Up to where a measured angle leaves the theoretical one, or `BELIEVED` without
        one of the two.
        """
        if self.measured_angle is None or self.theoretical_angle is None:
            return min(BELIEVED, self.test.largest_angle)
        order = np.argsort(self.measured_angle)
        measured = self.measured_angle[order]
        off = np.abs(measured - self.theoretical_angle[order])
        apart = np.flatnonzero(~(off <= APART))
        last = apart[0] - 1 if apart.size else measured.size - 1
        return float(measured[last]) if last >= 0 else 0.0

    def last_angle(self, up_to: float | None) -> float:
        """Shear angle in radians up to which points are fitted.

        That asked for, or `BELIEVED`, or any where the angle is measured; and not where
        the motion of the test ends.
        """
        if up_to is None:
            up_to = np.inf if self.measured_angle is not None else BELIEVED
        return min(up_to * (1 + _ROUNDING), _END * self.test.largest_angle)

    def used(self, up_to: float | None) -> ndarray:
        """Which points are fitted: from 0 to `last_angle`, shape (n,)."""
        with np.errstate(invalid="ignore"):
            return (self.angle >= 0) & (self.angle <= self.last_angle(up_to))

    @property
    def driven(self) -> ndarray:
        """Displacements, which drive the test, or angles where there are none."""
        return self.angle if self.displacement is None else self.displacement

    def ways(self, up_to: float | None) -> tuple[bool, bool]:
        """Loading and unloading beyond noise, within the points that are fitted."""
        way = self.driven[self.used(up_to)]
        forth, back = (
            bool(np.any(np.maximum.accumulate(x) - x > _BACK * np.ptp(way)))
            for x in (way[::-1], way)
        )
        return forth, back

    def pointwise(self, up_to: float | None) -> tuple[ndarray, ndarray]:
        """Shear angles that rise, and C by the reduction point by point."""
        used = self.used(up_to) & (self.angle > 0)
        order = np.argsort(self.angle[used], kind="stable")
        gamma, force = self.angle[used][order], self.force[used][order]
        moment = self.test.moment(gamma, force)
        known = np.isfinite(moment)
        return gamma[known], moment[known]


@dataclass(frozen=True, eq=False)
class ShearFit:
    """A shear law that was found from specimens.

    Attributes
    ----------
    fit
        Parameters and their confidence.
    specimens
        The curves.
    up_to
        Shear angle in radians up to which points were asked for, if it was given.
    stabilisation
        Largest share of the stabilisation in the energy of the simulations whose loads
        were compared; None where those of closed forms were.
    """

    fit: Fit
    specimens: tuple[Specimen, ...]
    up_to: float | None
    stabilisation: float | None = None

    @property
    def simulated(self) -> bool:
        """True if loads of simulations were compared, not those of closed forms."""
        return self.stabilisation is not None

    @property
    def largest_angle(self) -> float:
        """The largest shear angle that was fitted, in radians."""
        return max(float(s.angle[s.used(self.up_to)].max()) for s in self.specimens)


def read_specimen(
    path: str | os.PathLike[str],
    test: ShearTest,
    units: Mapping[str, str] | None = None,
) -> Specimen:
    """The specimen of a CSV file, which `read_curve` describes.

    It has a column ``force`` and one of ``displacement`` and ``shear angle``, or both:
    a measured angle counts more than the theoretical one.

    Parameters
    ----------
    path
        The file.
    test
        The kind of test and its sizes.
    units
        Units of columns that the file does not give.

    Raises
    ------
    ValueError
        If the file is refused, or a column is missing.
    OSError
        If it cannot be read.
    """
    name, columns = read_test(path, units, "force")
    if "displacement" not in columns and "shear angle" not in columns:
        raise ValueError(f"{name}: there is no column 'displacement' or 'shear angle'")
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
    """Find a shear law from specimens, by the forces that fibres without stretch give.

    Parameters
    ----------
    specimens
        The curves.
    law
        ``polynomial`` (odd powers), ``linear``, ``sin2``, ``locking`` or ``tabulated``.
    degree
        Highest power of the polynomial.
    points
        Points of the table beside 0.
    extrapolation
        Of the table beyond the data, ``refuse`` or ``linear``, as of `Tabulated`.
    up_to
        Shear angle in radians beyond which points are left out; see `Specimen.used`.
    bounds
        Least and largest value of parameters by name.
    ratios
        Of each specimen, the force over that of the closed form at shear angles.

    Raises
    ------
    ValueError
        If the law is unknown, or no table and has an extrapolation; if a specimen has
        no points in the range, angles that its test does not reach, or forces that push
        or do not change; or as from `regression.fit`.

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
        raise ValueError(f"the law {law!r} is none of {', '.join(SHEAR_LAWS)}")
    if up_to is not None and not up_to > 0:
        raise ValueError(
            f"the largest shear angle must be > 0, got {np.degrees(up_to):g} degrees"
        )
    if points < 1:
        raise ValueError(f"a table needs at least one point beside 0, got {points}")
    samples = [
        _sample(specimen, up_to, None if ratios is None else ratios[i])
        for i, specimen in enumerate(specimens)
    ]
    angles = [float(s.angle[s.used(up_to)].max()) for s in specimens]
    largest = max(angles, default=0.0)
    model = SHEAR_LAWS[law](largest, degree, points).bounded(bounds or {})
    found = fit(model.extrapolated(extrapolation), samples)
    return ShearFit(found, tuple(specimens), up_to)


def _sample(
    specimen: Specimen, up_to: float | None, ratio: Callable[[ndarray], ndarray] | None
) -> Sample:
    """The points of a specimen that are fitted, and the forces of a law there."""
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
            f"{name}: shear angles go up to {angles.max():.4g} degrees, but the test "
            f"ends at {end:.4g}: look at their unit"
        )
    if np.any(used & (specimen.angle > 0)):
        return
    last = np.degrees(specimen.last_angle(up_to))
    found = (
        f"they go from {angles.min():.3g} to {angles.max():.3g}"
        if angles.size
        else "all displacements are beyond the end of the test: look at their unit"
    )
    raise ValueError(
        f"{name}: no shear angle is between 0 and {last:.3g} degrees; {found}"
    )


def _refuse_forces(specimen: Specimen, used: ndarray) -> None:
    force = specimen.force[used]
    if force.size > 1 and np.ptp(force) == 0:
        raise ValueError(
            f"{specimen.name}: the force is {force[0]:g} N at every point: it must "
            "change with the shear angle"
        )
    if not force.sum() > 0:
        raise ValueError(
            f"{specimen.name}: forces are negative: a pull is positive, so turn the "
            "sign of the column"
        )


# The loads no longer change: by less than this share of the largest.  Chosen: a tenth
# of the uncertainty of a load from a curve with a noise of 1 %.
_SETTLED = 1e-3

# Simulations of each test at most; four are usual.
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
        Fibre stiffness in N/mm or tension law, as of `Fabric`.
    across
        Element edges across the width.
    steps
        Load steps, equal in the shear angle.
    seed
        Of the irregular mesh.
    """

    tension: Any = 1e5
    across: int = 12
    steps: int = 12
    seed: int = 1

    def __post_init__(self) -> None:
        if self.across < 2 or self.across % 2:
            raise ValueError(
                f"the number of elements across must be even and >= 2: {self.across}"
            )

    def curve(self, law: Law, test: BiasExtension, largest: float) -> Simulated:
        """The curve of a shear law from 0 up to a theoretical shear angle in radians.

        Raises
        ------
        ValueError
            If the simulation does not get there.
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
            raise ValueError(f"a simulation of the test fails: {error}") from None
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
    """Find a shear law with which simulated bias extensions have the measured loads.

    Parameters
    ----------
    specimens
        Curves of bias extensions, with displacements.
    law, degree, points, extrapolation, bounds
        As for `fit_shear`.
    simulation
        How the tests are simulated.
    up_to
        Theoretical shear angle in radians at the displacement beyond which points are
        left out; all points are taken without one.

    Raises
    ------
    ValueError
        As from `fit_shear`; if a specimen is no bias extension or has no displacements;
        or if a simulation fails, or the laws do not settle.
    """
    simulation = simulation or Simulation()
    for specimen in specimens:
        bias = isinstance(specimen.test, BiasExtension)
        if not bias or specimen.displacement is None:
            raise ValueError(
                f"{specimen.name}: only bias extensions with displacements are fitted "
                "by simulation"
            )
    driven = [replace(specimen, measured_angle=None) for specimen in specimens]
    end = np.inf if up_to is None else up_to
    how: dict[str, Any] = {"degree": degree, "points": points, "bounds": bounds}
    how["extrapolation"] = extrapolation
    found = fit_shear(driven, law, up_to=end, **how)
    largest = [float(s.angle[s.used(end)].max()) for s in driven]
    before = [np.full(1, np.inf) for _ in driven]
    for n in range(_MOST_ROUNDS):
        law_now = found.fit.law
        curves = _simulated(simulation, law_now, driven, largest)
        ratios = [_ratio(s.test, law_now, curves[s.test]) for s in driven]
        found = fit_shear(driven, law, up_to=end, **how, ratios=ratios)
        loads = [sample.predict(found.fit.law) for sample in found.fit.samples]
        change = max(
            float(np.abs(now - then).max() / np.abs(now).max())
            for now, then in zip(loads, before, strict=True)
        )
        log.info("simulation %d: loads change by %.3g of the largest", n + 1, change)
        if change < _SETTLED:
            shares = (curve.stabilisation for curve in curves.values())
            return replace(found, stabilisation=max(shares))
        before = loads
    raise ValueError(
        f"after {_MOST_ROUNDS} simulations the loads still change by {change:.2%}: "
        "take a law with fewer parameters, or --up-to a smaller angle"
    )


def _simulated(
    simulation: Simulation,
    law: Law,
    specimens: Sequence[Specimen],
    largest: Sequence[float],
) -> dict[Any, Simulated]:
    """The curve of each test; specimens of one size share a simulation."""
    if isinstance(law, Tabulated):  # some elements shear by more than the middle
        law = replace(law, extrapolation="linear")
    ends: dict[Any, float] = {}
    for specimen, end in zip(specimens, largest, strict=True):
        ends[specimen.test] = max(end, ends.get(specimen.test, 0.0))
    return {test: simulation.curve(law, test, end) for test, end in ends.items()}


def _ratio(test: ShearTest, law: Law, curve: Simulated) -> Callable[[ndarray], ndarray]:
    """The simulated load over that of the closed form."""
    ratio = curve.forces[1:] / test.force(law, curve.angles[1:])
    return PchipInterpolator(curve.angles, np.concatenate([ratio[:1], ratio]))
