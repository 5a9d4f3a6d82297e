"""Loading and unloading branches of a test."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy import ndarray

from .outliers import running_median

#: Reversal of the motion, relative to its range, between two branches.  Chosen: far
#: above the noise of a machine.
REVERSAL = 0.1

# Rows of the running median of the motion: spikes of one or two rows do not count as
# reversals.
_SMOOTH = 5

#: Rows by which turns of the running median and of the motion may differ.
AT_A_TURN = _SMOOTH // 2

# Distance to the end of a branch, relative to the range, within which the motion is at
# rest: the rows of a dwell belong to neither branch.
_DWELL = 0.005

# Share of the largest value that the first complete loading reaches.
_COMPLETE = 0.95


@dataclass(frozen=True)
class Branch:
    """Consecutive rows of one direction.

    Attributes
    ----------
    loading
        True for loading, False for unloading.
    cycle
        Number of the cycle from 1 on.
    begin, end
        First index, and the index after the last one.
    reach
        Largest value of the driving quantity.
    """

    loading: bool
    cycle: int
    begin: int
    end: int
    reach: float

    @property
    def kind(self) -> str:
        """The direction in words."""
        return "loading" if self.loading else "unloading"


def branches_of(x: ndarray) -> list[Branch]:
    """Branches of a motion, split where it reverses by more than `REVERSAL`.

    Parameters
    ----------
    x
        Driving quantity in the order of recording, shape (n,).
    """
    smooth = running_median(x, _SMOOTH) if x.size > _SMOOTH else x
    turns = _turning_points(smooth, REVERSAL * float(np.ptp(smooth)))
    branches: list[Branch] = []
    cycle = 1
    for begin, end in pairwise(turns):
        loading = bool(smooth[end] >= smooth[begin])
        if loading and branches:
            cycle += 1
        last = end + 1 if end == x.size - 1 else end
        reach = float(smooth[begin : end + 1].max())
        branches.append(Branch(loading, cycle, begin, last, reach))
    return [_without_dwell(smooth, one) for one in branches]


def first_complete(branches: list[Branch]) -> Branch:
    """First loading that reaches the largest value, or else the first branch."""
    loadings = [one for one in branches if one.loading]
    if not loadings:
        return branches[0]
    most = max(one.reach for one in loadings)
    return next(one for one in loadings if one.reach >= _COMPLETE * most)


def _turning_points(x: ndarray, least: float) -> list[int]:
    """Indices of the ends, and of extrema followed by a reversal."""
    turns, extreme, direction = [0], 0, 0
    for i in range(1, x.size):
        if direction == 0:
            if abs(x[i] - x[0]) > least:
                direction, extreme = int(np.sign(x[i] - x[0])), i
        elif (x[i] - x[extreme]) * direction > 0:
            extreme = i
        elif (x[extreme] - x[i]) * direction > least:
            turns.append(extreme)
            extreme, direction = i, -direction
    return [*turns, x.size - 1]


def _without_dwell(x: ndarray, branch: Branch) -> Branch:
    """The branch up to the first row at its end."""
    inside = x[branch.begin : branch.end]
    if inside.size < 2:
        return branch
    last = inside.max() if branch.loading else inside.min()
    near = np.abs(inside - last) <= _DWELL * np.ptp(x)
    end = branch.begin + int(np.argmax(near)) + 1
    if branch.end - end < _LONG_DWELL:
        return branch
    return Branch(branch.loading, branch.cycle, branch.begin, end, branch.reach)


# Fewest rows of a dwell: fewer may be steps smaller than its tolerance.
_LONG_DWELL = 5
