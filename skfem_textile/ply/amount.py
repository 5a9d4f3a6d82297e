"""Amounts: numbers, or vectors, as functions of the load factor.

A factor of a load, or a gap, is stated as a number or as a function of the load factor,
such as a `Programme`.  The package evaluates it as an `Amount`.
"""

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..fabric.law import keep
from ..mesh.user_input import call_user_function, real_numbers, shortened

#: A number, or a function of the load factor that returns one.
AmountLike: TypeAlias = float | Callable[[float], float]

# Round-off of a load factor.
_ROUND_OFF = 1e-15

#: Relative difference of two places between rows, or load factors, that is round-off.
SAME = 1e-9


def proportional(t: float) -> float:
    """The load factor itself."""
    return t


class Limits(NamedTuple):
    """Least and largest value of an amount, its unit, and its number of components."""

    least: float = -np.inf
    most: float = np.inf
    unit: str = ""
    components: int = 1

    @property
    def kind(self) -> str:
        """Description of such a number, in messages."""
        if self.least == -np.inf:
            return "a finite number"
        if self.most == np.inf:
            return f"a number of at least {self.least:g}{self.unit}"
        return f"a number from {self.least:g} to {self.most:g}{self.unit}"


_NONE = Limits()


@dataclass(frozen=True, eq=False)
class Amount:
    """Number as a function of the load factor, validated whenever it is evaluated.

    Attributes
    ----------
    what
        Its name in messages.
    stated
        The number or function of a user.  A function may have ``load_factors``, at
        which it bends, and ``check_steps``, see `Rows`.
    limits
        Its limits.
    """

    what: str
    stated: Any
    limits: Limits = _NONE

    def __call__(self, t: float) -> float:
        """Value at a load factor; a ValueError if it is not a number in the limits."""
        value, limits = self.stated, self.limits
        if callable(value):
            value = call_user_function(self.what, value, t)
        number = real_numbers(self.what, value)
        known = limits is _NONE or not isinstance(value, bool | np.bool_)
        within = np.isfinite(number) and limits.least <= number <= limits.most
        if number.shape or not (known and within):
            raise ValueError(
                f"{self.what} must be {limits.kind}, got {shortened(value)} at load "
                f"factor {t:g}"
            )
        return float(number)

    @property
    def load_factors(self) -> Sequence[float]:
        """Load factors at which it bends, if they are known."""
        return getattr(self.stated, "load_factors", ())

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """Refuse steps, given by the load factors at their ends, that miss a value."""
        if check := getattr(self.stated, "check_steps", None):
            check(load_factors)


def ends_of_parts(n: int) -> list[float]:
    """Load factors from 0 to 1 between n parts of equal length."""
    return np.linspace(0.0, 1.0, n + 1).tolist()


@dataclass(frozen=True, eq=False)
class Part:
    """Rows of a place and values, between two load factors.

    Attributes
    ----------
    what
        Name of the amount in messages.
    between
        The load factors.
    rows
        Place and values, shape (n, 1 + n_values).
    along
        Place as a function of the load factor; by default the share of the part.
    place
        Format of a place in messages.
    """

    what: str
    between: tuple[float, float]
    rows: ndarray
    along: Callable[[float], float] | None = None
    place: str = "share {:g}"

    def place_at(self, t: float) -> float:
        """Place at a load factor."""
        first, last = self.between
        return self.along(t) if self.along else (t - first) / (last - first)

    def __call__(self, t: float) -> Any:
        """Value, or vector of values, at a load factor."""
        x = self.place_at(t)
        at, *columns = self.rows.T
        values = [float(np.interp(x, at, column)) for column in columns]
        return np.array(values) if values[1:] else values[0]

    @property
    def load_factors(self) -> list[float]:
        """Load factors at its ends, and at its rows if they are known."""
        first, last = self.between
        if self.along:
            return [first, last]
        within = first + (last - first) * self.rows[1:-1, 0]
        return [first, *within.tolist(), last]

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """Refuse steps within which a value turns back, because they would miss it."""
        at, off = self.rows[:, 0], SAME * np.ptp(self.rows[:, 0])
        ends = np.array([self.place_at(t) for t in load_factors])
        low, high = np.sort([ends[:-1], ends[1:]], axis=0)
        for signs in np.sign(np.diff(self.rows[:, 1:], axis=0)).T:
            for i, j in pairwise(np.flatnonzero(signs)):
                first, last = at[i + 1], at[j]
                within = (low < first - off) & (last + off < high)
                if signs[i] != signs[j] and within.any():
                    raise ValueError(
                        f"{self.what} turns back at the {self.place.format(first)}, "
                        f"within one of {len(low)} steps: choose a number of steps of "
                        "which one ends there"
                    )


@dataclass(frozen=True, eq=False)
class Rows:
    """Piecewise linear function of the load factor, in parts of equal length.

    Attributes
    ----------
    parts
        The parts, such as the phases of a process; where two of them meet, the value is
        the one of the first.
    """

    parts: tuple[Part, ...]

    @classmethod
    def of(cls, what: str, rows: Sequence[Sequence[float]]) -> "Rows":
        """Function by rows of the load factor and values; ``what`` is for messages.

        Raises
        ------
        ValueError
            If the load factors do not increase from 0 to 1.
        """
        array = np.array(rows, dtype=float)
        at = array[:, 0]
        valid = bool(at[0] == 0 and at[-1] == 1)
        refuse_places(f"{what}: the load factors", at, "from 0 to 1", valid)
        return cls((Part(what, (0.0, 1.0), array, place="load factor {:g}"),))

    @classmethod
    def reaching(cls, value: ArrayLike) -> "Rows":
        """Function that reaches a value in proportion to the load factor."""
        end = np.hstack([1.0, value])
        rows = np.array([np.zeros(end.size), end])
        return cls((Part("", (0.0, 1.0), rows),))

    def __call__(self, t: float) -> Any:
        """Value, or vector of values, at a load factor; exact at the ends of parts."""
        ends, n = self._ends, len(self.parts)
        t = min(max(t, 0.0), 1.0)
        nearest = ends[round(t * n)]
        if abs(t - nearest) <= _ROUND_OFF:
            t = nearest
        return self.parts[max(bisect_left(ends, t) - 1, 0)](t)

    @property
    def _ends(self) -> list[float]:
        return [0.0, *(part.between[1] for part in self.parts)]

    @property
    def load_factors(self) -> list[float]:
        """Load factors at the ends of the parts, and of rows within them."""
        return sorted({t for part in self.parts for t in part.load_factors})

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """Refuse steps, given by the load factors at their ends, that miss a value."""
        n, found = len(self.parts), np.array([0.0, *load_factors])
        for part in self.parts:
            first, last = part.between
            within = found[(found >= first - SAME) & (found <= last + SAME)]
            if np.abs(found - last).min() > SAME:
                raise ValueError(
                    f"steps must be a multiple of {n}, the number of parts of the "
                    f"programme or phases of the process, or {n} numbers of steps, so "
                    f"that each part ends with a step; got {len(load_factors)}"
                )
            part.check_steps(within.tolist())


@dataclass(frozen=True)
class Programme(Rows):
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

    parts: tuple[Part, ...] = field(init=False, repr=False, compare=False)
    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        levels = real_numbers("levels of a programme", self.levels)
        if levels.ndim != 1 or not levels.size or not np.isfinite(levels).all():
            raise ValueError(
                "the levels of a programme must be finite numbers, such as [1, 0, 1], "
                f"got {shortened(self.levels)}"
            )
        ends = pairwise(ends_of_parts(levels.size))
        steps = pairwise([0.0, *levels.tolist()])
        parts = [
            Part("the programme", between, np.transpose([(0.0, 1.0), values]))
            for between, values in zip(ends, steps, strict=True)
        ]
        keep(self, levels=tuple(levels.tolist()), parts=tuple(parts))


@dataclass(frozen=True)
class Following:
    """Function whose load factor, its last argument, follows a programme."""

    of: Callable[..., Any]
    programme: Programme

    def __call__(self, *arguments: Any) -> Any:
        """Value at the level of the programme at a load factor."""
        *others, t = arguments
        return self.of(*others, self.programme(t))

    @property
    def load_factors(self) -> list[float]:
        """See `Rows.load_factors`."""
        return self.programme.load_factors

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """See `Rows.check_steps`."""
        self.programme.check_steps(load_factors)


def refuse_places(what: str, places: ndarray, limits: str, valid: bool) -> None:
    """Refuse places of rows that do not increase, or are not ``valid``.

    ``limits`` says from where to where they increase, for messages.
    """
    if not valid or (np.diff(places) <= 0).any():
        raise ValueError(
            f"{what} of the rows must increase {limits}, got "
            f"{', '.join(f'{x:g}' for x in places)}"
        )
