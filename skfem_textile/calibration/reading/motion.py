"""Motion and force of the tables of a file: segments of one test, noise, directions."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from ..outliers import FEWEST
from .quantities import FORCES, SPECIMENS

# Driving quantities of a biaxial test.
_STRAINS = "warp strain", "weft strain"

# Driving quantities, one of which a shear or tensile test requires.
_DRIVING = "displacement", "shear angle", "strain"

# Share of the motion below which a difference is none: of a beginning from rest.
_NONE = 0.06

# Longest pause between segments, in steps of the clock within them.
_PAUSE = 3.0

# Degree of the smooth curve of a trend, such as loading and unloading; and number of
# classes in which a force is compared with its scatter.
_DEGREE, _CLASSES = 3, 10

# Share of a variance above which a trend exceeds the scatter.
_HALF = 0.5

_LABEL = re.compile(r"(\w+)\W*(?:(?:no|nr|id|name|number)\b\W*)?(\w[\w.-]*)\W*")


@dataclass(frozen=True, eq=False)
class Segment:
    """Motion of a table.

    Attributes
    ----------
    moved
        Driving quantity of its rows with numbers, shape (n,).
    others
        Columns that are not quantities of a test, by position; one may be a clock.
    label
        Specimen that a title above the table names; empty if none.
    """

    moved: ndarray
    others: Mapping[int, ndarray]
    label: str


def moved_in(columns: Mapping[str, ndarray]) -> ndarray:
    """Driving quantity in the rows with numbers; empty if there is none."""
    for name in driving_in(columns):
        return columns[name][np.isfinite(columns[name])]
    return np.zeros(0)


def driving_in(columns: Mapping[str, ndarray]) -> list[str]:
    """Driving quantities; of a biaxial test the strain with the larger range."""
    ranges = {
        name: float(np.ptp(known)) if (known := x[np.isfinite(x)]).size else 0.0
        for name in _STRAINS
        if (x := columns.get(name)) is not None
    }
    largest = [max(ranges, key=lambda name: ranges[name])] if ranges else []
    return [name for name in _DRIVING if name in columns] or largest


def label_of(titles: Sequence[Sequence[str]]) -> str:
    """Specimen named by the last title such as ``Specimen 2``; empty if none."""
    for cells in reversed(titles):
        found = _LABEL.fullmatch(" ".join(filter(None, cells)))
        if found and found[1].lower() in SPECIMENS:
            return found[2]
    return ""


def goes_on(test: Sequence[Segment], following: Segment, motion: float) -> bool:
    """True if a table continues a test.

    It does if it names no other specimen, and begins nearer to the end of the test
    than to its beginning.  A test that has returned to its beginning continues only if
    a column increases throughout, as a clock.

    Parameters
    ----------
    test
        Segments of the test, with motions.
    following
        The next table, with a motion.
    motion
        Range of the driving quantity of all tables.
    """
    if following.label and following.label != test[-1].label:
        return False
    moved = np.concatenate([one.moved for one in test])
    begin, end, next_ = moved[0], moved[-1], following.moved[0]
    near = bool(abs(next_ - end) <= _NONE * motion)
    if min(np.ptp(moved), np.ptp(following.moved)) <= _NONE * motion:
        return near  # a segment at rest is not a test
    if abs(end - begin) > _NONE * motion:
        return bool(abs(next_ - end) < abs(next_ - begin))
    return near and any(
        _ticks(test[-1].others[i], following.others[i])
        for i in test[-1].others.keys() & following.others.keys()
    )


def jumps_back(moved: ndarray, next_: float, motion: float) -> bool:
    """True if the next row of a table is back by more than half of its motion.

    No machine returns within one row.
    """
    travel, jump = moved[-1] - moved[0], next_ - moved[-1]
    return bool(travel * jump < 0 and abs(jump) > 0.5 * motion)


def _ticks(before: ndarray, after: ndarray) -> bool:
    """True if a column increases from row to row, and without a long pause."""
    steps = np.append(np.diff(before), np.diff(after))
    pause = after[0] - before[-1]
    return bool(steps.size and steps.min() > 0 and 0 < pause <= _PAUSE * steps.max())


def _without_spikes(values: ndarray) -> ndarray:
    """Values with their outliers moved to the 5 % and 95 % quantiles."""
    return np.clip(values, *np.quantile(values, [0.05, 0.95]))


def explained_by_order(values: ndarray) -> float:
    """Share of the variance that a cubic trend over the rows explains."""
    rows = np.linspace(-1.0, 1.0, values.size)
    trend = np.polynomial.Polynomial.fit(rows, values, _DEGREE)
    return _share(values, trend(rows))


def explained(values: ndarray, by: ndarray) -> float:
    """Share of the variance that means in classes of another column explain."""
    rank = np.searchsorted(np.sort(by), by)
    of_class = _CLASSES * rank // by.size
    counts = np.bincount(of_class)
    means = np.bincount(of_class, values) / np.maximum(counts, 1)
    return _share(values, means[of_class])


def is_no_motion(moved: ndarray, forces: Sequence[ndarray]) -> bool:
    """True if a column is noise: no trend over the rows, and no force depends on it.

    Parameters
    ----------
    moved
        The column, shape (n,).
    forces
        Forces in the same rows.
    """
    known = np.all(np.isfinite([moved, *forces]), axis=0)
    if known.sum() < FEWEST:
        return False
    x, *of_forces = (_without_spikes(each[known]) for each in (moved, *forces))
    if explained_by_order(x) >= _HALF:
        return False
    return all(explained(force, x) < _HALF for force in of_forces)


def is_noise(force: ndarray, moved: ndarray) -> bool:
    """True if a force neither depends on the motion nor on its previous values.

    The mean square of the differences of successive values is twice the variance of
    independent ones (von Neumann 1941, Ann. Math. Statist. 12:367).
    """
    known = np.isfinite(force) & np.isfinite(moved)
    if known.sum() < FEWEST:
        return False
    f, x = (_without_spikes(each[known]) for each in (force, moved))
    independent = np.mean(np.diff(f) ** 2) > 2 * _HALF * f.var() > 0
    return bool(independent and explained(f, x) < _HALF)


def _share(values: ndarray, smooth: ndarray) -> float:
    """Share of the variance of values that a smooth curve explains."""
    total = float(np.sum((values - values.mean()) ** 2))
    return 1 - float(np.sum((values - smooth) ** 2)) / total if total else 0.0


def turned_columns(
    columns: Mapping[str, ndarray], known: Collection[str]
) -> dict[str, ndarray]:
    """Columns of which the sign must be turned, with this sign.

    A force has the sign of its large values.  A displacement is turned if large
    forces are at small displacements.

    Parameters
    ----------
    columns
        Columns by quantity.
    known
        Quantities of which the sign is given.
    """
    turned = {
        name: -columns[name]
        for name in FORCES
        if name in columns and name not in known and _points_down(columns[name])
    }
    moved, force = (
        turned.get(name, columns.get(name)) for name in ("displacement", "force")
    )
    free = "displacement" not in known
    if free and force is not None and moved is not None and _opposed(moved, force):
        turned["displacement"] = -moved
    return turned


def _points_down(force: ndarray) -> bool:
    """True if forces of large magnitude are negative."""
    known = force[np.isfinite(force)]
    if not known.size:
        return False
    large = np.abs(known) >= np.quantile(np.abs(known), 0.8)
    return bool(np.median(known[large]) < 0)


def _opposed(moved: ndarray, force: ndarray) -> bool:
    """True if displacements of large forces are smaller than at small ones.

    Small forces before the large ones decide; later ones may follow a break.
    """
    known = np.isfinite(moved) & np.isfinite(force)
    x, f = moved[known], force[known]
    if x.size < 2:
        return False
    low, high = np.quantile(f, [0.2, 0.8])
    small, large = np.flatnonzero(f <= low), np.flatnonzero(f >= high)
    before = small[small < large[0]]
    return bool(np.median(x[large]) < np.median(x[before if before.size else small]))


def falls(force: ndarray) -> bool:
    """True if the force at the first rows exceeds that at the last rows."""
    thirds = np.array_split(force[np.isfinite(force)], 3)
    return bool(np.median(thirds[0]) > np.median(thirds[-1]))
