"""Curves of shear specimens: angles, zeros and the range of the kinematics."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy import ndarray

from ..fabric import Polynomial
from ..scenes.shear_test import ShearTest
from .measured import MeasuredTest, beyond_slack, slack_range
from .outliers import running_median
from .preparing import REVERSAL, Preparation, prepare
from .reading import Format, read_recordings

#: Shear angle in radians up to which the theoretical one of a test that does not impose
#: it is reliable.  Cao et al.  (2008) find that it fails beyond 30 to 45 degrees.
BELIEVED = float(np.radians(40.0))

#: Difference in radians of measured and theoretical angle above which there is slip.
APART = float(np.radians(2.0))

#: Rounding tolerance of the ends of the range.
ROUNDING = 1e-9

#: Share of the largest angle of a test, or of the pole of a law, above which forces are
#: not computed: they are unbounded there.
END_OF_RANGE = 0.999

# Column of a curve that is already reduced to a law.
_REDUCED = "normalised shear force"

# Number of slacks that are compared for a start.
_SLACKS = 71

# Share of the measured angles, from the smallest on, that determine the slack.
_EARLY = 1 / 3


@dataclass(frozen=True)
class Zeros:
    """Zeros of a testing machine; None for those that a fit is to determine.

    Attributes
    ----------
    slack
        Displacement in mm at which the fabric begins to carry load.
    force
        Force in N of the undeformed fabric, such as the weight of a clamp.
    """

    slack: float | None = 0.0
    force: float | None = 0.0


@dataclass(frozen=True, eq=False)
class Specimen(MeasuredTest):
    """Curve of one specimen.

    Attributes
    ----------
    test
        Kind of test and its dimensions.
    force
        Force in N, shape (n,).
    displacement, measured_angle
        Displacement in mm, and shear angle in radians, shape (n,); one of them may be
        missing.
    zeros
        Zeros of the machine.
    assumed_slack
        Slack in mm that determines the fitted points if it is unknown: `fit_tests`
        repeats a fit with the fitted slack until these points are its own.  None for
        the slack of a polynomial through the whole curve.
    range_end
        Shear angle in radians up to which points are fitted by default; None for
        `kinematics_limit`.
    """

    test: ShearTest
    force: ndarray
    displacement: ndarray | None = None
    measured_angle: ndarray | None = None
    zeros: Zeros = Zeros()
    assumed_slack: float | None = None
    range_end: float | None = None

    @property
    def parts(self) -> tuple[str, ...]:
        """See `MeasuredTest.parts`."""
        return ("shear",)

    @property
    def assumes_slack(self) -> bool:
        """True if the slack is assumed: neither given, nor by a measured angle."""
        unknown = self.zeros.slack is None and self.displacement is not None
        return unknown and self.measured_angle is None

    @cached_property
    def slack(self) -> float:
        """Slack in mm: as given, by the kinematics of a measured angle, or assumed."""
        if self.assumes_slack:
            given = self.assumed_slack
            return _slack_of_whole_curve(self) if given is None else given
        if self.zeros.slack is not None or self.displacement is None:
            return self.zeros.slack or 0.0
        assert self.measured_angle is not None
        early = self.measured_angle <= _EARLY * self.measured_angle.max()
        moved = self.test.displacement(self.measured_angle[early])
        return float(np.median(self.displacement[early] - moved))

    def with_slack(self, zeros: Mapping[str, float]) -> Self:
        """See `MeasuredTest.with_slack`."""
        return replace(self, assumed_slack=zeros["slack"]) if "slack" in zeros else self

    def angle_at(self, displacement: ndarray, slack: float) -> ndarray:
        """Theoretical shear angle; 0 within a slack, and nan beyond the end."""
        moved = beyond_slack(displacement, slack, self.zeros.slack is not None)
        return self.test.shear_angle(moved)

    @cached_property
    def theoretical_angle(self) -> ndarray | None:
        """Shear angle for inextensible fibres without slip; nan beyond the end."""
        if self.displacement is None:
            return None
        return self.angle_at(self.displacement, self.slack)

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

        The largest angle of a test that imposes it.  Otherwise up to the angle at which
        the measured one departs from the theoretical one, by wrinkling or slip, or
        `BELIEVED` if one of the two is missing.
        """
        end, measured = self.test.largest_angle, self.measured_angle
        if self.test.imposes_angle:
            return end
        if measured is None or self.displacement is None:
            return min(BELIEVED, end)
        rows = self._before_departure
        return float(measured[rows[-1]]) if rows.size else 0.0

    @property
    def departure(self) -> float:
        """Theoretical shear angle in radians at which a measured one departs from it.

        Infinite if it does not, or if one of the two is missing.
        """
        if self.measured_angle is None or self.theoretical_angle is None:
            return np.inf
        rows = self._before_departure
        if rows.size == self.force.size:
            return np.inf
        return float(self.theoretical_angle[rows[-1]]) if rows.size else 0.0

    @cached_property
    def _before_departure(self) -> ndarray:
        """Rows with increasing measured angles up to their departure."""
        assert self.measured_angle is not None
        departed = self.difference > APART
        order = np.argsort(self.measured_angle)
        return order[: np.argmax(departed)] if departed.any() else order

    @cached_property
    def difference(self) -> ndarray:
        """Smoothed difference of measured and theoretical angle in radians, (n,).

        In the order of increasing measured angles; infinite beyond the end of the test.
        """
        assert self.measured_angle is not None
        assert self.theoretical_angle is not None
        off = np.abs(self.measured_angle - self.theoretical_angle)
        off = off[np.argsort(self.measured_angle)]
        return running_median(np.where(np.isfinite(off), off, np.inf))

    def last_angle(self, up_to: float | None) -> float:
        """Shear angle in radians up to which points are fitted.

        The requested angle; by default `range_end`, or the limit of the kinematics, or
        unlimited if only the angle is measured; at most the end of the motion of the
        test.
        """
        if up_to is None:
            up_to = self.range_end
        if up_to is None:
            alone = self.measured_angle is not None and self.displacement is None
            up_to = np.inf if alone else self.kinematics_limit
        return min(up_to * (1 + ROUNDING), END_OF_RANGE * self.test.largest_angle)

    def used(self, up_to: float | None) -> ndarray:
        """Mask of the fitted points: from 0 to `last_angle`, shape (n,)."""
        with np.errstate(invalid="ignore"):
            at_rest_or_beyond = self.angle >= -ROUNDING
            return at_rest_or_beyond & (self.angle <= self.last_angle(up_to))

    @property
    def driven(self) -> ndarray:
        """Displacements, which drive the test, or angles if there are none."""
        return self.angle if self.displacement is None else self.displacement

    def ways(self, up_to: float | None) -> tuple[bool, bool]:
        """Loading and unloading beyond noise, within the fitted points."""
        driven = self.driven[self.used(up_to)]
        forth, back = (
            bool(np.any(np.maximum.accumulate(x) - x > REVERSAL * np.ptp(driven)))
            for x in (driven[::-1], driven)
        )
        return forth, back

    def pointwise(self, up_to: float | None) -> tuple[ndarray, ndarray]:
        """Increasing shear angles, and C by pointwise data reduction."""
        used = self.used(up_to) & (self.angle > 0)
        order = np.argsort(self.angle[used], kind="stable")
        gamma, force = self.angle[used][order], self.force[used][order]
        moment = self.test.moment(gamma, force - (self.zeros.force or 0.0))
        known = np.isfinite(moment)
        return gamma[known], moment[known]


def read_specimens(
    path: str | os.PathLike[str],
    test: ShearTest,
    form: Format | None = None,
    choices: Preparation | None = None,
) -> list[Specimen]:
    """Specimens of a file or folder, prepared for a fit.

    Each has a force and one or both of displacement and shear angle: a measured angle
    takes precedence over the theoretical one.

    Parameters
    ----------
    path, form
        See `read_recordings`, with its errors.
    test
        Kind of test and its dimensions.
    choices
        See `prepare`, with its errors.

    Raises
    ------
    ValueError
        If both displacement and shear angle are missing, a slack is given for a test
        without displacement, or the forces are already reduced.
    """
    choices = choices or Preparation()
    specimens = []
    for recording in read_recordings(path, form):
        columns = recording.columns
        if "force" not in columns and _REDUCED in columns:
            raise ValueError(
                f"{recording.name}: a {_REDUCED} is already a law, and needs no fit: "
                "use the file in its place, as for run --shear-law"
            )
        if "force" in columns and not {"displacement", "shear angle"} & set(columns):
            raise ValueError(
                f"{recording.name}: a column 'displacement' or 'shear angle' is "
                "required: name it in the file, or specify it with --column"
            )
        driving = "displacement" if "displacement" in columns else "shear angle"
        if driving != "displacement":
            choices.refuse_slack(recording.name, "shear angles")
        both = recording.complete(*{driving, "shear angle"} & set(columns))
        prepared = prepare(both, driving, ["force"], choices)
        zeros = map(prepared.zero, (choices.slack, choices.force_at_rest))
        read = prepared.recording
        moved, angle = read.columns.get("displacement"), read.columns.get("shear angle")
        specimens.append(
            Specimen(
                *(read.name, test, read.column("force"), moved, angle),
                zeros=Zeros(*zeros),
                prepared=prepared,
                cyclic=choices.cycles,
            )
        )
    return specimens


def _slack_of_whole_curve(specimen: Specimen) -> float:
    """Slack of the best polynomial of degree 5, with or without a force at rest.

    It is 0 unless the data contradict it, by the Bayesian information criterion.  All
    slacks are compared at the same points, within the range or not.
    """
    assert specimen.displacement is not None
    slacks = np.linspace(*slack_range(specimen.displacement), _SLACKS)
    free = {False, specimen.zeros.force is None}
    log_n = float(np.log(specimen.force.size))  # of the slack, a further parameter
    found = [
        (_misfit(specimen, s, force) + log_n * (s != 0.0), s)
        for force in free
        for s in (0.0, *slacks)
    ]
    return float(min(found)[1])


def _misfit(specimen: Specimen, slack: float, force_is_free: bool) -> float:
    """Bayesian information criterion of a polynomial of degree 5 with this slack."""
    assert specimen.displacement is not None
    gamma = specimen.angle_at(specimen.displacement, slack)
    gamma = np.fmin(gamma, END_OF_RANGE * specimen.test.largest_angle)
    laws = [Polynomial((1.0,)), Polynomial((0, 0, 1.0)), Polynomial((0, 0, 0, 0, 1.0))]
    columns = [specimen.test.force(law, gamma) for law in laws]
    columns += [np.ones(gamma.size)] * force_is_free
    A, b = np.transpose(columns), specimen.force - (specimen.zeros.force or 0.0)
    rest = b - A @ np.linalg.lstsq(A, b)[0]
    n = b.size
    variance = max(float(rest @ rest), 1e-18 * float(b @ b)) / n
    return n * np.log(variance) + force_is_free * np.log(n)
