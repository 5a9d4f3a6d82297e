"""Preparation of recordings for a fit: branch, outliers and origin, each stated."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy import ndarray

from .outliers import CLOSE, NORMAL, departures, outliers, overloads, running_median
from .reading import Recording, rows_text

#: Branches by name.
BRANCHES = "loading", "unloading", "both"

#: Reversal of the motion, relative to its range, between two branches.  Chosen: far
#: above the noise of a machine.
REVERSAL = 0.1

# Rows by which turns of the running median and of the motion may differ.
_AT_A_TURN = CLOSE // 2

# Distance to the end of a branch, relative to the range, within which the motion is at
# rest: the rows of a dwell belong to neither branch.
_DWELL = 0.005

# Fewest rows of a dwell: fewer may be steps smaller than its tolerance.
_LONG_DWELL = 5

# Share of the largest value that the first complete loading reaches.
_COMPLETE = 0.95

#: Largest distance of the first point from rest, relative to the range.
FIRST = 0.06

# Largest force of the first rows, relative to the largest one, at rest.
_AT_REST = 0.05

# Rows of the beginning of a curve, whose median force is that at rest.
_BEGINNING = 3

# Jump of the driving quantity, relative to its range, in a single row, and in standard
# deviations of its noise: no machine moves this far forth and back between readings.
_JUMP, _DEVIATIONS = 0.02, 10.0

# Force, relative to the largest one, below which a curve that ends is broken.  Chosen:
# loads of fabrics that slip or wrinkle fall by less, and noise is far smaller.
_BROKEN = 0.5

# Number of points at which two branches are compared.
_COMPARED = 50


@dataclass(frozen=True)
class Preparation:
    """Choices that take precedence over the content of a recording.

    Parameters
    ----------
    branch
        ``loading``, ``unloading`` or ``both``.
    cycle
        Number of the cycle from 1 on; by default the first one that reaches the largest
        displacement, or every cycle for ``both``.
    slack
        Displacement in mm at which the fabric begins to carry load; by default it is
        estimated.
    force_at_rest
        Force in N of the undeformed fabric; by default it is estimated.
    outliers
        True if outliers are left out.
    cycles
        True if all rows in their order determine the friction of the law: every branch
        and cycle.

    Raises
    ------
    ValueError
        If a cycle is given with ``cycles``, the branch is unknown, the cycle is not
        positive, or a number is not finite.
    """

    branch: str = "loading"
    cycle: int | None = None
    slack: float | None = None
    force_at_rest: float | None = None
    outliers: bool = True
    cycles: bool = False

    def __post_init__(self) -> None:
        if self.cycles:
            if self.cycle is not None:
                raise ValueError(
                    "the cycles are all used with --cycles: omit it, or --cycle"
                )
            object.__setattr__(self, "branch", "both")
        if self.branch not in BRANCHES:
            raise ValueError(
                f"the branch must be one of {', '.join(BRANCHES)}, got {self.branch!r}"
            )
        if self.cycle is not None and self.cycle < 1:
            raise ValueError(f"cycles are numbered from 1 on, got {self.cycle}")
        for name, unit in (("slack", "mm"), ("force_at_rest", "N")):
            value = getattr(self, name)
            if value is not None and not np.isfinite(value):
                called = name.replace("_", " ")
                raise ValueError(f"the {called} must be finite, got {value:g} {unit}")

    def refuse_slack(self, name: str, columns: str) -> None:
        """An error if a slack is given for a test without displacement.

        Parameters
        ----------
        name
            Name of the test.
        columns
            Its columns in the place of the displacement.
        """
        if self.slack:
            raise ValueError(
                f"{name}: a slack of {self.slack:g} mm requires a displacement, but "
                f"the file contains {columns}: omit --slack, or subtract the slack in "
                "the file"
            )


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


@dataclass(frozen=True, eq=False)
class Prepared:
    """Recording prepared for a fit.

    Attributes
    ----------
    recording
        The selected rows.  Displacements begin at `origin`.
    read
        The recording as read.
    driving, forces
        Names of the driving quantity and of the measured ones.
    branches
        Branches of the recording as read.
    outliers
        Lines of the file that were left out as outliers, shape (k,).
    origin
        Displacement of the machine at the beginning that was subtracted, in mm.
    begins_at_rest
        True if the curve begins near rest, so that slack and force at rest can be
        estimated.
    """

    recording: Recording
    read: Recording
    driving: str
    forces: tuple[str, ...]
    branches: tuple[Branch, ...] = ()
    outliers: ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    origin: float = 0.0
    begins_at_rest: bool = True

    def zero(self, given: float | None) -> float | None:
        """Zero of the machine: as given, None if a fit determines it, or else 0."""
        return given if self.begins_at_rest or given is not None else 0.0


def prepare(
    recording: Recording,
    driving: str,
    forces: Sequence[str],
    choices: Preparation | None = None,
) -> Prepared:
    """Prepare a recording: complete rows of one branch without outliers.

    Parameters
    ----------
    recording
        The recording as read.
    driving
        Driving quantity, which determines the branches.
    forces
        Quantities whose outliers are determined.
    choices
        Choices that take precedence.

    Raises
    ------
    ValueError
        If a column is missing, a branch or cycle does not exist, or forces of a few
        rows are far above all others without being outliers of a smooth curve.
    """
    choices = choices or Preparation()
    complete = recording.complete(driving, *forces)
    jumps = _jumps(complete.column(driving)) & choices.outliers
    clean = complete.select(~jumps)
    branches = _branches_of(clean.column(driving))
    each, statements = _chosen(clean, driving, forces[0], branches, choices)
    chosen = np.concatenate(each)
    branch = clean.select(chosen)
    wrong = _wrong(clean, driving, forces, each)[chosen] & choices.outliers
    statements += _outlier_statements(complete, driving, jumps)
    for name in forces:
        statements += _outlier_statements(branch, name, wrong)
    kept = branch.select(~wrong)
    if choices.outliers:
        _refuse_overloads(kept, driving, forces)
        broken = _broken(kept, driving, forces) & (choices.branch != "both")
        statements += _broken_statements(kept, forces[0], broken)
        kept = kept.select(~broken)
    origin, at_rest, said = _origin(kept, driving, forces[0], choices)
    columns = dict(kept.columns)
    if origin:
        columns[driving] = columns[driving] - origin
    prepared = Recording(
        kept.name, columns, kept.rows, (*kept.statements, *statements, *said)
    )
    left_out = np.concatenate([complete.rows[jumps], branch.rows[wrong]])
    return Prepared(
        *(prepared, recording, driving, tuple(forces)),
        *(tuple(branches), left_out, origin, at_rest),
    )


def _wrong(
    recording: Recording, driving: str, forces: Sequence[str], each: list[ndarray]
) -> ndarray:
    """Mask of the outliers of each branch, given by the indices of its rows.

    The rows next to a turn may belong to either branch, and count if they are outliers
    of both.
    """
    number = recording.rows.size
    wrong, seen = np.zeros(number, dtype=int), np.zeros(number, dtype=int)
    more = _AT_A_TURN if len(each) > 1 else 0
    for rows in each:
        near = np.arange(max(rows[0] - more, 0), min(rows[-1] + 1 + more, number))
        branch = recording.select(near)
        x = branch.column(driving)
        found = [outliers(x, branch.column(name)) for name in forces]
        wrong[near] += np.any(found, axis=0)
        seen[near] += 1
    return (wrong > 0) & (wrong == seen)


def _jumps(x: ndarray) -> ndarray:
    """Mask of rows of the driving quantity that deviate from their neighbours."""
    if x.size <= CLOSE:
        return np.zeros(x.size, dtype=bool)
    smooth = running_median(x)
    noise = NORMAL * float(np.median(np.abs(x - smooth)))
    least = max(_JUMP * float(np.ptp(smooth)), _DEVIATIONS * noise)
    return departures(x) > least


def _chosen(
    recording: Recording,
    driving: str,
    force: str,
    branches: list[Branch],
    choices: Preparation,
) -> tuple[list[ndarray], list[str]]:
    """Indices of the rows of each chosen branch, and statements."""
    number = choices.cycle
    if choices.branch == "both":
        cycles = [b for b in branches if number in (None, b.cycle)]
    else:
        if number is None and branches:
            number = _first_complete(branches).cycle
        loading = choices.branch == "loading"
        cycles = [b for b in branches if b.loading == loading and b.cycle == number]
    if not cycles and choices.cycle is None and choices.branch == "loading":
        return [np.arange(recording.rows.size)], [
            "the displacement only decreases from row to row, as in unloading: check "
            "that the law may be determined from unloading"
        ]
    if not cycles:
        cycle = f" of cycle {number}" if number else ""
        most = max((b.cycle for b in branches), default=0)
        raise ValueError(
            f"{recording.name}: there is no {choices.branch}{cycle}: the test has "
            f"{most} cycle(s)"
        )
    rows = [np.arange(b.begin, b.end) for b in cycles]
    if len(branches) < 2:
        return rows, []
    return rows, [_of_branches(recording, driving, force, branches, cycles)]


def _of_branches(
    recording: Recording,
    driving: str,
    force: str,
    branches: list[Branch],
    chosen: list[Branch],
) -> str:
    """Statement on the branch that is used, and on the next one."""
    first, last = chosen[0], chosen[-1]
    rows = recording.rows
    cycles = max(b.cycle for b in branches)
    kinds = " and ".join(dict.fromkeys(b.kind for b in chosen))
    used = f"cycle {first.cycle} of {cycles} is"
    if last.cycle > first.cycle:
        used = f"cycles {first.cycle} to {last.cycle} of {cycles} are"
    text = f"{kinds} of {used} used, rows {rows[first.begin]} to {rows[last.end - 1]}"
    if len(chosen) == len(branches):
        return text
    following = next((b for b in branches if b.begin >= last.end - 1), None)
    if following is None or len(chosen) > 1 or following.loading == first.loading:
        return f"{text}; other rows are left out"
    x, f = recording.column(driving), recording.column(force)
    one, two = (_curve(x, f, branch) for branch in (first, following))
    low = max(one[0][0], two[0][0])
    high = min(one[0][-1], two[0][-1])
    at = np.linspace(low, high, _COMPARED)
    before, after = np.interp(at, *one), np.interp(at, *two)
    change = (after.sum() - before.sum()) / np.abs(before).sum()
    word = "below" if change < 0 else "above"
    return (
        f"{text}; {following.kind} is left out, on average {abs(100 * change):.0f} % "
        f"{word} it (--branch)"
    )


def _curve(x: ndarray, force: ndarray, branch: Branch) -> tuple[ndarray, ndarray]:
    """Increasing driving quantity of a branch, and smoothed forces."""
    inside = slice(branch.begin, branch.end)
    order = np.argsort(x[inside], kind="stable")
    return x[inside][order], running_median(force[inside][order])


def _outlier_statements(recording: Recording, name: str, wrong: ndarray) -> list[str]:
    if not wrong.any():
        return []
    values = recording.column(name)[wrong]
    return [
        f"{rows_text(recording.rows[wrong])}: outliers of the {name}, such as "
        f"{values[np.abs(values).argmax()]:.5g}: left out (--keep-outliers)"
    ]


def _refuse_overloads(
    recording: Recording, driving: str, forces: Sequence[str]
) -> None:
    order = np.argsort(recording.column(driving), kind="stable")
    for name in forces:
        values = recording.column(name)[order]
        if (far := overloads(values)).any():
            raise ValueError(
                f"{recording.name}: the {name} of {values[far][0]:.5g} in "
                f"{rows_text(np.sort(recording.rows[order][far]))} is far above all "
                "other rows, as in an overload: remove it from the file, or fit it "
                "with --keep-outliers"
            )


def _broken(recording: Recording, driving: str, forces: Sequence[str]) -> ndarray:
    """Mask of the last rows of a curve with one force, if it falls and stays low."""
    force, broken = recording.column(forces[0]), np.zeros(recording.rows.size, bool)
    order = np.argsort(recording.column(driving), kind="stable")
    held = np.flatnonzero(force[order] >= _BROKEN * force.max())
    if len(forces) == 1 and force.max() > 0:
        broken[order[held[-1] + 1 :]] = True
    return broken


def _broken_statements(recording: Recording, force: str, broken: ndarray) -> list[str]:
    if not broken.any():
        return []
    return [
        f"{rows_text(recording.rows[broken])}: the {force} is less than half of the "
        "largest one up to the end, as after a break: left out (--keep-outliers)"
    ]


def _origin(
    recording: Recording, driving: str, force: str, choices: Preparation
) -> tuple[float, bool, list[str]]:
    """Displacement to subtract, whether the curve begins at rest, and statements."""
    x, f = recording.column(driving), recording.column(force)
    size, first = float(np.ptp(x)), float(x[0])
    if abs(first) <= FIRST * size + 2 * abs(float(x[min(1, x.size - 1)] - x[0])):
        return 0.0, True, []
    most = float(np.abs(f).max())
    loaded = not abs(float(np.median(f[:_BEGINNING]))) < _AT_REST * most
    if loaded or driving != "displacement" or choices.slack is not None:
        return 0.0, False, []
    return (
        first,
        True,
        [
            f"displacements are counted from {first:.5g} mm, at row "
            f"{recording.rows[0]}, where the force is virtually zero (--slack)"
        ],
    )


def _branches_of(x: ndarray) -> list[Branch]:
    """Branches of a motion, split where it reverses by more than `REVERSAL`.

    Parameters
    ----------
    x
        Driving quantity in the order of recording, shape (n,).
    """
    smooth = running_median(x) if x.size > CLOSE else x
    first, *turns, end = _turning_points(smooth, REVERSAL * float(np.ptp(smooth)))
    turns = [first, *(_extreme(x, smooth, turn) + 1 for turn in turns), end + 1]
    branches: list[Branch] = []
    cycle = 1
    for begin, last in pairwise(turns):
        end = last - 1
        loading = bool(smooth[end] >= smooth[begin])
        if loading and branches:
            cycle += 1
        reach = float(smooth[begin : end + 1].max())
        branches.append(Branch(loading, cycle, begin, last, reach))
    return [_without_dwell(smooth, one) for one in branches]


def _first_complete(branches: list[Branch]) -> Branch:
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


def _extreme(x: ndarray, smooth: ndarray, turn: int) -> int:
    """Index of the last row of a branch: of the extremum that a median flattens."""
    low, high = max(turn - _AT_A_TURN, 0), min(turn + _AT_A_TURN + 1, x.size)
    rises = smooth[turn] > smooth[[low, high - 1]].mean()
    near = x[low:high]
    return low + int(near.argmax() if rises else near.argmin())


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
    return replace(branch, end=end)
