"""Damped fixed point of the parameters of the terms."""

from dataclasses import dataclass, field

import numpy as np

from ..ply.parameters import Frozen, PlyParameters, Values
from .direction import NEAR, Iterate
from .problem import Problem

#: Share of the energy and of the largest reaction by which an update of the parameters
#: may change them at a state.
SETTLED = 0.0025


def between(before: PlyParameters, after: PlyParameters, share: float) -> PlyParameters:
    """Parameters interpolated between two sets."""

    def mixed(old: Values, new: Values) -> Values:
        return type(old)({name: x + share * (new[name] - x) for name, x in old.items()})

    return Frozen({term: mixed(old, after[term]) for term, old in before.items()})


@dataclass
class Damped:
    """Fixed-point iteration whose updates are halved unless changes decrease by half.

    Attributes
    ----------
    change
        Change by the last update.
    share
        Share of an update that is applied.
    """

    change: float = np.inf
    share: float = 1.0

    def converges(self, change: float, limit: float) -> bool:
        """True if this change and all further ones add up to at most a limit.

        Further changes form a geometric series with the ratio of the last two.
        """
        return change <= limit * (1.0 - (change / self.change if change else 0.0))

    def __call__(
        self, before: PlyParameters, after: PlyParameters, change: float
    ) -> PlyParameters:
        """Parameters after an update that causes a change."""
        if change > self.change / 2:
            self.share /= 2
        self.change = change
        return after if self.share == 1.0 else between(before, after, self.share)


@dataclass
class NearEquilibrium:
    """Updates of the parameters in an iteration near its equilibrium.

    Each one requires a tenth of the residual of the previous one, and uses the
    predicted tensions.  Between tools they continue to the equilibrium; elsewhere until
    one changes the energy by less than `SETTLED`, or by more than half of the previous
    change.

    Parameters
    ----------
    problem
        The problem.
    """

    problem: Problem
    _near: float = NEAR
    _damped: Damped = field(default_factory=Damped)

    def __call__(self, at: Iterate) -> Iterate:
        """The iterate, with updated parameters if it is near enough."""
        problem, p = self.problem, at.parameters
        if not at.unbalanced(problem) < self._near:
            return at
        self._near *= NEAR
        after = problem.ply.updated(p, at.u, problem.load_factor, at.tension)
        if after is p:
            return at
        if not problem.contacts:
            change, last = self._change(at, after), self._damped.change
            if not SETTLED < change <= last / 2:
                self._near = 0.0
            if change <= SETTLED / 2 and last < np.inf:
                return at
            after = self._damped(p, after, change)
        return at._replace(parameters=after, f=problem.residual(at.u, after))

    def _change(self, at: Iterate, after: PlyParameters) -> float:
        """Relative change of the energy by an update."""
        both = (self.problem.energies(at.u, p)[0] for p in (at.parameters, after))
        old, new = (sum(energies.values()) for energies in both)
        return abs(new - old) / abs(old) if old else np.inf


def unchanged(at: Iterate) -> Iterate:
    """The iterate, without an update."""
    return at
