"""A shear law from picture-frame or bias-extension tests of several specimens."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy import ndarray

from ..fabric import Law
from ..scenes.shear_test import ShearTest
from . import models
from .curves import read_curve
from .models import Model
from .regression import Fit, Sample, fit

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

# Share of the largest angle of a test beyond which points tell nothing: forces of the
# closed form have no bound there.
_END = 0.999

#: Shear laws by name, of the largest angle, the degree, and the number of points.
SHEAR_LAWS: dict[str, Callable[[float, int, int], Model]] = {
    "polynomial": lambda largest, degree, points: models.polynomial(degree),
    "linear": lambda largest, degree, points: models.linear(),
    "sin2": lambda largest, degree, points: models.sin2(),
    "locking": lambda largest, degree, points: models.locking(largest),
    "tabulated": lambda largest, degree, points: models.tabulated(
        np.linspace(0.0, largest, points + 1)[1:]
    ),
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
        """That of fibres that do not stretch or slip; nan past its end."""
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

    def turns_back(self, up_to: float | None) -> bool:
        """Whether the test goes back and forth within the points that are fitted."""
        way = self.driven[self.used(up_to)]
        return _falls(way) and _falls(way[::-1])

    def is_unloading(self, up_to: float | None) -> bool:
        """Whether it only goes back within the points that are fitted."""
        way = self.driven[self.used(up_to)]
        return _falls(way) and not _falls(way[::-1])

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
        """Whether loads of simulations were compared, and not those of closed forms."""
        return self.stabilisation is not None

    @property
    def largest_angle(self) -> float:
        """That of the points that were fitted, in radians."""
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
        Units of columns that the file does not tell.

    Raises
    ------
    ValueError
        If the file is refused, or a column is missing.
    OSError
        If it cannot be read.
    """
    columns = read_curve(path, units)
    name = Path(path).name
    if "force" not in columns:
        raise ValueError(f"{name}: there is no column 'force'")
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
    samples, largest = [], 0.0
    for i, specimen in enumerate(specimens):
        used = specimen.used(up_to)
        _refuse_angles(specimen, used, up_to)
        _refuse_forces(specimen, used)
        gamma = specimen.angle[used]
        ratio = np.ones(gamma.size) if ratios is None else ratios[i](gamma)
        predict = partial(_force, test=specimen.test, gamma=gamma, ratio=ratio)
        samples.append(Sample(specimen.name, specimen.force[used], predict))
        largest = max(largest, float(gamma.max()))
    model = SHEAR_LAWS[law](largest, degree, points).bounded(bounds or {})
    found = fit(model.extrapolated(extrapolation), samples)
    return ShearFit(found, tuple(specimens), up_to)


def _falls(way: ndarray) -> bool:
    """Whether it falls by more than noise anywhere."""
    back = np.maximum.accumulate(way) - way
    return bool(np.any(back > _BACK * np.ptp(way)))


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


def _force(law: Law, test: ShearTest, gamma: ndarray, ratio: ndarray) -> ndarray:
    return ratio * test.force(law, gamma)
