"""Tables of a file that are segments of one test, such as pages with headings."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy import ndarray

from .quantities import SPECIMENS

# Share of the motion below which a difference is none: of a beginning from rest.
_NONE = 0.06

# Longest pause between segments, in steps of the clock within them.
_PAUSE = 3.0

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
    others: Mapping[int, ndarray] = field(default_factory=dict)
    label: str = ""


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
