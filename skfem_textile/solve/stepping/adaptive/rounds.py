"""What a run to a tolerance leaves behind: its rounds, and the last result."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...result import Result

#: Unknowns at most, unless told otherwise: a run that reaches them takes about 80 s on
#: one core, with all of its meshes (`skfem-textile run bias_extension --mesh delaunay
#: --size 10x20 --tolerance 1e-6 --no-render --out DIR`).
MOST_UNKNOWNS = 50_000

# What an estimate counts: on refined meshes it was up to a third too small,
# `python -m studies adaptive`.
_MARGIN = 1.5


@dataclass(frozen=True)
class Round:
    """A mesh of the loop, and what was found on it.

    Attributes
    ----------
    unknowns
        Number of unknowns.
    linear_solves
        Linear solves that the state took.
    whole_path
        Whether the whole load was applied, and not only its end.
    load_change
        Change of the load since the round before, as a share of it; None at first.
    estimated_load_error
        As of `Result.summary`.
    error
        What counts: the largest of one and a half times the estimate, changes on this
        mesh, and half of what counted on the last coarser mesh that has an estimate.
        Infinite where there is no estimate.
    """

    unknowns: int
    linear_solves: int
    whole_path: bool
    load_change: float | None
    estimated_load_error: float | None
    error: float

    def __str__(self) -> str:
        shares = self.load_change, self.estimated_load_error
        change, error = ("none" if x is None else f"{x:.2%}" for x in shares)
        return (
            f"{self.unknowns} unknowns, {self.linear_solves} linear solves"
            f"{', whole path' if self.whole_path else ''}, load changed by {change}, "
            f"estimated error {error}"
            + (f", counted as {self.error:.2%}" if self.error < np.inf else "")
        )


@dataclass(frozen=True, eq=False)
class AdaptiveResult(Result):
    """The result on the last mesh, and the rounds that led to it.

    Attributes
    ----------
    tolerance
        Error of the load that was asked for, as a share of it.
    rounds
        All rounds, that of the last mesh included.
    """

    tolerance: float
    rounds: tuple[Round, ...]

    @property
    def tolerance_met(self) -> bool:
        """Whether the whole load was applied, and its estimated error is small."""
        last = [one for one in self.rounds[-1:] if one.whole_path]
        return self.converged and any(one.error <= self.tolerance for one in last)

    def summary(self) -> dict[str, Any]:
        """As of `Result`, with ``tolerance``, ``tolerance_met`` and ``rounds``."""
        return super().summary() | {
            "tolerance": self.tolerance,
            "tolerance_met": self.tolerance_met,
            "rounds": [_finite(asdict(one)) for one in self.rounds],
        }


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    """A row with None in place of what is infinite."""
    return {key: None if value == np.inf else value for key, value in row.items()}


def counted(
    rounds: Sequence[Round], unknowns: int, change: float | None, estimate: float | None
) -> float:
    """What counts as the error of a round, see `Round`."""
    if estimate is None:
        return np.inf
    at_once = [one.load_change for one in rounds if one.unknowns == unknowns]
    coarser = [one.error for one in rounds if one.unknowns < unknowns]
    before = [error for error in coarser if error < np.inf][-1:]
    changes = [x for x in (change, *at_once) if x is not None]
    return max([_MARGIN * estimate, *changes, *(error / 2 for error in before)])
