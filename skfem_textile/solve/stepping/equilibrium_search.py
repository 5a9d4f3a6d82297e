"""The search for a state at one load factor: strategies, one after the other."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..problem import Problem, Start
from ..states import Equilibrium, Iteration, NoEquilibriumError
from ..strategies import STRATEGIES, Strategy, balanced
from ..verdict import Trial

_AT_REST = (
    "less tension, compression or load at rest, loads that grow with the load factor, "
    "or more shear stiffness"
)


class Goal(NamedTuple):
    """What to reach, and from where.

    Attributes
    ----------
    load_factor, step
        Load factor, and its distance from that of the last good state.
    fixed_values
        Values of the fixed unknowns.
    start, energy
        The last good state, and its energy in N·mm.
    most_altered
        How many tangents may be altered on the way; if not any number, only strategies
        that follow the path are tried.
    """

    load_factor: float
    step: float
    fixed_values: ndarray
    start: Start
    energy: float
    most_altered: float = np.inf


@dataclass(frozen=True)
class EquilibriumSearch:
    """Strategies, and what their states must stand.

    Attributes
    ----------
    problem, strategies
        What to solve, and what to try, in this order.
    warn_only
        Checks of `CHECKS` that do not refuse a state but only warn.
    report
        Told of each iteration.
    """

    problem: Problem
    strategies: Sequence[Strategy]
    warn_only: Collection[str]
    report: Callable[[Iteration], None]

    def __call__(self, goal: Goal) -> tuple[Trial, bool]:
        """A state that passes every check, and whether its search was on the path.

        Raises
        ------
        NoEquilibriumError
            If no strategy finds one.
        """
        strategies = self.strategies
        if np.isfinite(goal.most_altered):
            strategies = [s for s in strategies if follows_path(s)]
        failures: dict[str, NoEquilibriumError] = {}
        for strategy in strategies:
            try:
                with np.errstate(all="ignore"):  # what is not finite is caught
                    trial = self._trial_by(strategy, goal)
            except NoEquilibriumError as failure:
                failures.setdefault(str(failure), failure)
            else:
                return trial, follows_path(strategy)
        advice = next(iter(failures.values())).advice
        raise NoEquilibriumError(
            f"no acceptable state at {goal.load_factor:.6g}: {'; '.join(failures)}",
            next((f.elements for f in failures.values() if f.elements.size), ()),
            advice if goal.load_factor else _AT_REST,
        )

    def _trial_by(self, strategy: Strategy, goal: Goal) -> Trial:
        """A state that one strategy finds.

        On the way to a state in which all corners are open none resists: it is shorter.
        """
        problem = self.problem.at(goal.load_factor)
        if strategy is self.strategies[0] and problem.ply.corners_open(goal.start.u):
            open_corners = problem.without_corners()
            equilibrium = self._balanced(open_corners, strategy, goal)
            if problem.ply.corners_open(equilibrium.u):
                return self._checked(problem, equilibrium, goal)
        equilibrium = self._balanced(problem, strategy, goal)
        return self._checked(problem, equilibrium, goal)

    def _balanced(
        self, problem: Problem, strategy: Strategy, goal: Goal
    ) -> Equilibrium:
        name = type(strategy).__name__.lower()

        def report(number: int, residual: float, tolerance: float) -> None:
            place = goal.load_factor, goal.step
            self.report(Iteration(*place, name, number, residual, tolerance))

        return balanced(
            problem,
            strategy.iterates(problem, goal.start, goal.fixed_values),
            goal.fixed_values,
            strategy.most,
            goal.most_altered,
            report,
        )

    def _checked(self, problem: Problem, equilibrium: Equilibrium, goal: Goal) -> Trial:
        """The trial of an equilibrium that passes every check."""
        energies, potentials = problem.energies(equilibrium.u)
        rise = sum(energies.values()) - goal.energy
        start = goal.start if goal.step else None
        trial = Trial(problem, equilibrium, start, rise, energies, potentials)
        trial.apply_checks(self.warn_only)
        return trial


def strategy_of(strategy: str | Strategy) -> Strategy:
    """A strategy, or the one of that name.

    Raises
    ------
    ValueError
        If there is none, or it is allowed no iteration.
    """
    if isinstance(strategy, str):
        if strategy not in STRATEGIES:
            raise ValueError(
                f"unknown strategy {strategy!r}: choose of {', '.join(STRATEGIES)}"
            )
        return STRATEGIES[strategy]
    if isinstance(strategy, type) or not hasattr(strategy, "iterates"):
        raise ValueError(f"{strategy} is neither a strategy nor the name of one")
    if strategy.most < 1:
        raise ValueError(f"{strategy} must be allowed at least one iteration")
    return strategy


def follows_path(strategy: Strategy) -> bool:
    """Whether the tangents that a strategy alters tell if it stays on the path."""
    return getattr(strategy, "follows_path", False)
