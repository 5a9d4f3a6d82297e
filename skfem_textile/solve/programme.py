"""Load programmes, and rows of values: amounts that rise and fall with the load."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric.law import keep
from ..mesh.user_input import real_numbers, shortened

# Round-off of a load factor.
_ROUND_OFF = 1e-15

# Relative difference of two places between rows that is round-off.
_SAME = 1e-9


@dataclass(frozen=True)
class Programme:
    """Factor that passes through given levels, in parts of equal length.

    It is the ``factor`` of a `Condition` or a load: while the load factor increases
    from 0 to 1, it starts at 0 and is linear from each level to the next.  A
    `LoadStepper` requires that a step ends at each level, because a step that passes a
    level would miss it.

    Parameters
    ----------
    levels
        Factors at the ends of the parts.

    Raises
    ------
    ValueError
        If there is no level, or one is not a finite number.

    Examples
    --------
    Loading, unloading to a fifth, and loading again:

    >>> programme = Programme([1.0, 0.2, 1.0])
    >>> [round(programme(t), 3) for t in (0.0, 1 / 6, 1 / 3, 2 / 3, 1.0)]
    [0.0, 0.5, 1.0, 0.2, 1.0]
    """

    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        levels = real_numbers("levels of a programme", self.levels)
        if levels.ndim != 1 or not levels.size or not np.isfinite(levels).all():
            raise ValueError(
                "the levels of a programme must be finite numbers, such as [1, 0, 1], "
                f"got {shortened(self.levels)}"
            )
        keep(self, levels=tuple(levels.tolist()))

    @property
    def parts(self) -> int:
        """Number of parts."""
        return len(self.levels)

    def __call__(self, t: float) -> float:
        """Factor at the load factor t, which is exact at the ends of the parts."""
        ends = (0.0, *self.levels)
        place = min(max(t, 0.0), 1.0) * self.parts
        nearest = round(place)
        if abs(place - nearest) <= _ROUND_OFF * self.parts:
            return ends[nearest]
        first = int(place)
        share = place - first
        return (1 - share) * ends[first] + share * ends[first + 1]

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """Refuse steps, given by the load factors at their ends, that pass a level."""
        for level in range(1, self.parts):
            off = min(abs(t * self.parts - level) for t in load_factors)
            if off > _ROUND_OFF * self.parts:
                raise ValueError(
                    f"steps must be a multiple of {self.parts}, the number of parts of "
                    f"the programme, or {self.parts} numbers of steps, so that each "
                    f"part ends with a step; got {len(load_factors)}"
                )


@dataclass(frozen=True)
class BetweenRows:
    """Piecewise linear function of the load factor.

    Parameters
    ----------
    what
        Its name in messages.
    rows
        Load factor and values of each row.

    Raises
    ------
    ValueError
        If the load factors do not increase from 0 to 1.
    """

    what: str
    rows: Sequence[Sequence[float]]

    def __post_init__(self) -> None:
        factors = self._array[:, 0]
        if (np.diff(factors) <= 0).any() or factors[0] != 0 or factors[-1] != 1:
            raise ValueError(
                f"{self.what}: the load factors of the rows must increase from 0 to 1, "
                f"got {', '.join(f'{t:g}' for t in factors)}"
            )

    @property
    def _array(self) -> ndarray:
        return np.array(self.rows, dtype=float)

    def __call__(self, t: float) -> Any:
        """Value, or vector of values, at a load factor."""
        return interpolated(self._array, t)

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """Refuse steps, given by the load factors at their ends, that pass a turn."""
        ends = np.array([0.0, *load_factors])
        refuse_turns(self.what, "load factor {:g}", self._array, ends)


def interpolated(rows: ndarray, x: float) -> Any:
    """Value, or vector of values, between rows of a place and values."""
    at, *columns = rows.T
    values = [float(np.interp(x, at, column)) for column in columns]
    return np.array(values) if values[1:] else values[0]


def refuse_turns(what: str, place: str, rows: ndarray, ends: ndarray) -> None:
    """Refuse rows of which a value turns back within a step, which would miss it.

    Parameters
    ----------
    what, place
        The amount, and the place of a row as a format of a number, in messages.
    rows
        Place and values of each row, shape (n, 1 + n_values).
    ends
        Places at the ends of the steps, shape (n_steps + 1,).
    """
    at, off = rows[:, 0], _SAME * np.ptp(rows[:, 0])
    low, high = np.sort([ends[:-1], ends[1:]], axis=0)
    for signs in np.sign(np.diff(rows[:, 1:], axis=0)).T:
        for i, j in pairwise(np.flatnonzero(signs)):
            first, last = at[i + 1], at[j]
            within = (low < first - off) & (last + off < high)
            if signs[i] != signs[j] and within.any():
                raise ValueError(
                    f"{what} turns back at the {place.format(first)}, within one "
                    f"of {len(ends) - 1} steps: choose a number of steps of which one "
                    "ends there"
                )
