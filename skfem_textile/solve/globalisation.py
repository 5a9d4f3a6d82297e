"""Globalisation of an iteration: the share of an increment that is applied."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy import ndarray

from ..ply.parameters import PlyParameters
from .direction import Increment, Iterate
from .problem import EPSILON, Problem

# Trial lengths of an increment, each half the previous one, until every law has a value
# or the energy decreases.  The last, 2⁻¹¹, is shorter than any in a converging
# iteration.
_HALVINGS = 12

# Share of the predicted decrease of the energy that an increment must reach (Armijo's
# rule, with the constant of Nocedal & Wright, Numerical Optimization, 2006, section
# 3.1).
_ARMIJO = 1e-4


@dataclass
class Whole:
    """Full increments, limited in length and to the domains of all laws.

    The first increment of a ply in its plane has any length: it brings the fixed
    unknowns to their values.

    Parameters
    ----------
    problem
        The problem.
    longest
        Largest change of the displacement gradient in an increment.
    """

    problem: Problem
    longest: float = np.inf

    def __call__(self, at: Iterate, increment: Increment) -> tuple[Iterate, Increment]:
        """Iterate to continue from, and the shortened increment."""
        problem, du = self.problem, increment.du
        if at.tension is not None or problem.in_space:
            du = du / max(1.0, problem.ply.largest_gradient(du) / self.longest)
        du = within_laws(problem, at.u, du, at.parameters)
        return at, increment._replace(du=du)


@dataclass
class Descent(Whole):
    """Line search or watchdog: the energy must decrease after a few increments.

    If the energy has not decreased after an increment and ``patience`` further ones,
    the iteration goes back to the displacement before the first of them and halves it:
    a backtracking line search for a patience of 0, else the watchdog technique of
    Chamberlain et al. (1982; Nocedal & Wright 2006, section 15.6).  The first increment
    of a ply in its plane is exempt.

    Parameters
    ----------
    patience
        Number of further increments.
    """

    patience: int = 0
    _watched: "tuple[Line, Increment] | None" = None
    _left: int = 0

    def __call__(self, at: Iterate, increment: Increment) -> tuple[Iterate, Increment]:
        """Iterate to continue from, this or an earlier one, and the increment there."""
        at, increment = super().__call__(at, increment)
        if at.tension is None:
            return at, increment
        if self._watched is None:
            line = Line(self.problem, at, increment.du)
            self._watched, self._left = (line, increment), self.patience
        line, first = self._watched
        if line.falls_to(self.problem.moved(at.u, increment.du)):
            self._watched = None
        elif not self._left:
            at, increment = line.at, first._replace(du=line.halved())
            self._watched = None
        self._left -= 1
        return at, increment


@dataclass(frozen=True, eq=False)
class Line:
    """Energy along an increment.

    Attributes
    ----------
    problem, at, du
        The problem, the iterate before the increment, and the increment.
    """

    problem: Problem
    at: Iterate
    du: ndarray

    @cached_property
    def energy(self) -> float:
        """Energy before the increment in N·mm."""
        return self.problem.energy(self.at.u, self.at.parameters)

    def falls_to(self, u: ndarray, share: float = 1.0) -> bool:
        """Armijo's condition for a share of the increment, with the slope f·du.

        Also true if the slope is not negative.
        """
        slope, round_off = float(self.at.f @ self.du), 8 * EPSILON * abs(self.energy)
        if slope >= 0:
            return True
        fall = self.problem.energy(u, self.at.parameters) - self.energy
        return fall <= _ARMIJO * share * slope + round_off

    def halved(self) -> ndarray:
        """Backtrack until the energy decreases; the full increment if it never does."""
        for share in 0.5 ** np.arange(1, _HALVINGS):
            if self.falls_to(self.problem.moved(self.at.u, share * self.du), share):
                return share * self.du
        return self.du


def within_laws(
    problem: Problem, u: ndarray, du: ndarray, parameters: PlyParameters
) -> ndarray:
    """Halve an increment until every law is defined after it; error if none is."""
    for share in 0.5 ** np.arange(_HALVINGS):
        if problem.in_domain(u + share * du, parameters):
            return share * du
    raise problem.beyond(
        u + share * du,
        "even the shortest increment leaves the domain of a law",
        "a law with a larger domain (for a table: more points, or "
        "extrapolation='linear'), or a smaller load",
    )
