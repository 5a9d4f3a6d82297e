"""Checks of the beginning and the angles of a test curve.

An undeformed fabric carries no force.  A curve that begins with a nonzero force
includes the weight of clamps, the friction of a frame or a pretension, which no law
represents.
"""

import numpy as np
from numpy import ndarray

from .preparing import FIRST
from .specimens import APART, Specimen

# Initial range of a curve: its share of the whole range, the minimum number of points,
# and the largest share covered by these.  Chosen: a curve is nearly straight there.
_BEGINNING, _FEWEST, _FARTHEST = 0.2, 5, 0.35

# Thresholds for reporting a force at rest: relative to the largest force, and in
# standard deviations.  Chosen: noise exceeds it in one of a million curves.
_SHARE, _DEVIATIONS = 0.05, 5.0

# A curve begins late if its first point is beyond this share of the range, with less
# than this share of the largest force.
_LATE, _NOTHING = 0.2, 0.05

# Relative difference below which steps are equal; they are unequal above ten times
# this.
_EQUAL, _UNEQUAL = 0.02, 0.2

# Minimum number of steps for this check.
_FEWEST_STEPS = 8


def force_at_rest(x: ndarray, force: ndarray) -> float:
    """Force of a curve at 0; 0 if it may be noise.

    It is the intercept of a straight line through the beginning.  The noise is the
    larger of the values from second differences and from the line.  If a parabola, or
    the mean of the first two points, gives less than half of this force, the curve
    rises steeply from rest, as with friction in a frame, and has no force at rest.
    """
    order = np.argsort(x, kind="stable")
    x, force = x[order], force[order]
    end = float(x[-1])
    n = max(int(np.sum(x <= _BEGINNING * end)), _FEWEST)
    if len(x) <= n or not abs(x[0]) <= FIRST * end or x[n - 1] > _FARTHEST * end:
        return 0.0
    z, f = x[:n] / end, force[:n]
    if not np.all(np.diff(z) > 0):
        return 0.0
    line, parabola = (np.polynomial.Polynomial.fit(z, f, d) for d in (1, 2))
    intercept, curved = float(line(0.0)), float(parabola(0.0))
    of_line = np.sqrt(np.sum((f - line(z)) ** 2) / (n - 2))
    of_curve = np.sqrt(np.mean(np.diff(force, 2) ** 2) / 6)
    spread = np.sqrt(1 / n + z.mean() ** 2 / np.sum((z - z.mean()) ** 2))
    least = max(
        _SHARE * float(np.abs(force).max()),
        _DEVIATIONS * spread * max(of_line, of_curve),
    )
    signed = np.sign(intercept) * np.array([curved, f[:2].mean()])
    steep = signed.min() < 0.5 * abs(intercept)
    return intercept if abs(intercept) > least and not steep else 0.0


def seems_swapped(driven: ndarray, force: ndarray) -> bool:
    """True if forces increase in equal steps, and the driving quantity does not.

    Testing machines move in equal steps: columns may be swapped, or the test is
    force-controlled.
    """
    if len(force) <= _FEWEST_STEPS or np.diff(force).min() <= 0:
        return False
    return _unevenness(force) < _EQUAL and _unevenness(driven) > _UNEQUAL


def rest_notes(
    name: str, x: ndarray, force: ndarray, slack_is_known: bool = True
) -> list[str]:
    """Note on a curve, given by name, with a force at rest or a late beginning.

    A late beginning is a slack, and not reported if the fit determines it.
    """
    first = np.abs(force[np.argsort(x, kind="stable")][:2]).max()
    if x.min() > _LATE * x.max() and first < _NOTHING * np.abs(force).max():
        late = (
            f"{name}: the curve begins far from rest with virtually no force: measure "
            "displacements from the point at which the fabric begins to carry load"
        )
        return [late] if slack_is_known else []
    offset = force_at_rest(x, force)
    if not offset:
        return []
    share = 100 * abs(offset) / np.abs(force).max()
    return [
        f"{name}: the force at rest is about {offset:.3g} N, {share:.0f} % of the "
        "largest force, and no law represents it: subtract the weight of clamps, "
        "friction and pretension before the fit"
    ]


def beginning_notes(specimen: Specimen, up_to: float | None) -> list[str]:
    """Notes on the order of the rows, swapped columns, and the beginning."""
    name, used = specimen.name, specimen.used(up_to)
    forth, back = specimen.ways(up_to)
    if forth and back:
        return []
    notes = []
    if back:
        notes.append(
            f"{name}: the displacement only decreases from row to row, as in "
            "unloading: keep the rows of the loading"
        )
    force = specimen.force[used]
    if seems_swapped(specimen.driven[used], force):
        what = "shear angle" if specimen.displacement is None else "displacement"
        notes.append(
            f"{name}: the force increases in equal steps and the {what} does not: "
            "check whether the columns are swapped, unless the test was "
            "force-controlled"
        )
    zeros = specimen.zeros
    if zeros.force is None or zeros.slack is None:
        return notes
    return notes + rest_notes(name, specimen.angle[used], force - zeros.force)


def departure_notes(specimen: Specimen, up_to: float | None) -> list[str]:
    """Notes on a measured angle that differs from the one of a frame or simulation."""
    name, departure, used = specimen.name, specimen.range_end, specimen.used(up_to)
    if departure is not None and np.isfinite(departure):
        where, end = np.degrees([departure, specimen.angle[used].max()])
        use = "the range ends there (--up-to)"
        if up_to is not None:
            use = f"points up to {end:.1f} degrees are fitted"
        return [
            f"{name}: beyond {where:.1f} degrees the measured angle differs from the "
            f"theoretical one by more than {np.degrees(APART):g} degrees, as by slip, "
            f"which is not simulated: {use}"
        ]
    if not specimen.test.imposes_angle or specimen.measured_angle is None:
        return []
    if specimen.displacement is None:
        return []
    order = np.argsort(specimen.measured_angle)
    largest = float(specimen.difference[used[order]].max())
    if largest <= APART:
        return []
    return [
        f"{name}: the measured angle differs from the angle of the frame by up to "
        f"{np.degrees(largest):.1f} degrees: the law is fitted with the measured angle"
    ]


def _unevenness(values: ndarray) -> float:
    """Largest deviation of a step from the mean step, relative to it."""
    steps = np.diff(values)
    mean = abs(steps.mean())
    return float(np.abs(steps - steps.mean()).max() / mean) if mean else np.inf
