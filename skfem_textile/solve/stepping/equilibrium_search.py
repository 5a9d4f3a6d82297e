"""The search for a state at one load factor: strategies, one after the other."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..problem import Goal, Problem, Start
from ..states import Equilibrium, Iteration, NoEquilibriumError
from ..strategies import LESS_ROUNDING, STRATEGIES, Strategy, balanced
from ..verdict import Trial
from .load_path import MOST_ALTERED

_AT_REST = (
    "less tension, compression or load at rest, loads that grow with the load factor, "
    "or more shear stiffness"
)

# Share of the largest reaction, and of the energy, by which the stiffnesses at a state
# may change it.  Reactions alone tell nothing where they balance a load, or each other.
# Chosen: with what further times would change, half of a percent at most.
_SETTLED = 0.0025

# How often a state is found again.  Each time about a quarter of the change is left; in
# coarse quadratic triangles at 60 degrees of shear it is half.
_TIMES = 4

# The shortest step to balance at rest, as a share of what is not balanced: of a ply
# that is stable there, and of another.  With longer ones heavy cantilevers with little
# bending stiffness are refused; with shorter ones a refusal takes longer.
_SHORTEST_AT_REST = 2.0**-12, 2.0**-6


class Found(NamedTuple):
    """A state that passes every check, and how it was found.

    Attributes
    ----------
    trial
        The state.
    altered
        Tangents that were altered on the way, at most, where it was found again.
    followed_path
        Whether its altered tangents tell if it is on the path.
    settled
        Whether the stiffnesses that the discretisation has at the state would not
        change it.
    solves_again
        Linear solves after it was found for the first time.
    """

    trial: Trial
    altered: int
    followed_path: bool
    settled: bool
    solves_again: int = 0


@dataclass(frozen=True)
class EquilibriumSearch:
    """Strategies, and what their states must stand.

    A stabilisation and what meets deviations take their stiffness from a state near the
    one that is sought.  Where that was not near enough, the state is found again.

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

    def __call__(self, goal: Goal) -> Found:
        """A state that passes every check.

        Raises
        ------
        NoEquilibriumError
            If no strategy finds one.
        """
        found, clock = self._first(goal), self.problem.clock
        before = clock.solves
        for _ in range(_TIMES):
            with np.errstate(all="ignore"):  # what is not finite is caught
                start = _start_of_another(found.trial)
            if start is None:
                found = found._replace(settled=True)
                break
            # It is near, so that the way to it is easy.
            most_altered = min(goal.most_altered, MOST_ALTERED)
            try:
                again = self._first(
                    goal._replace(start=start, most_altered=most_altered)
                )
            except NoEquilibriumError:
                break
            altered = max(found.altered, again.altered)
            followed_path = found.followed_path and again.followed_path
            found = Found(again.trial, altered, followed_path, settled=False)
        return found._replace(solves_again=clock.solves - before)

    def at_rest(self, start: Start, fixed_values: ndarray) -> Found:
        """The state at the load factor 0 of a ply that is not in balance there.

        What is not balanced at rest, such as a constant weight, is held at first, and
        let go in steps that shrink where the way is hard.  Prescribed displacements
        grow with it.  A ply that is not stable at rest may have no path from there:
        what the shortest step cannot let go is then let go at once, by whatever way
        the iteration takes.

        Parameters
        ----------
        start
            The undeformed ply.
        fixed_values
            Values of the fixed unknowns at the load factor 0.

        Raises
        ------
        NoEquilibriumError
            If there is no acceptable state.
        """
        unbalanced, u, tangent = start.f, start.u, start.tangent
        p = start.parameters
        done, step, most, altered, followed = 0.0, 1.0, float(MOST_ALTERED), 0, True
        stable = tangent is not None and tangent.negative_pivots == 0
        shortest = _SHORTEST_AT_REST[0 if stable else 1]
        while True:
            share = min(1.0, done + step)
            held = (1.0 - share) * unbalanced
            begin = self.problem.holding(held).start(u, p, tangent)
            goal = Goal(0.0, 0.0, share * fixed_values, begin, None, most, held)
            try:
                found = self(goal)
            except NoEquilibriumError:
                step /= 2
                if step < shortest:
                    if stable or most == np.inf:
                        raise
                    step, most = 1.0, np.inf
                continue
            altered = max(altered, found.altered)
            followed = followed and found.followed_path
            if share == 1.0:
                return found._replace(altered=altered, followed_path=followed)
            last = found.trial.next_start()
            u, p, tangent = last.u, last.parameters, last.tangent
            done, step = share, 2 * step

    def _first(self, goal: Goal) -> Found:
        """The state that the first strategy finds which finds any.

        Raises
        ------
        NoEquilibriumError
            If no strategy finds one.
        """
        strategies = self.strategies
        if np.isfinite(goal.most_altered):
            strategies = [s for s in strategies if follows_path(s)] or strategies
        failures: dict[str, NoEquilibriumError] = {}
        for strategy in strategies:
            try:
                with np.errstate(all="ignore"):  # what is not finite is caught
                    trial = self._trial_by(strategy, goal)
            except NoEquilibriumError as failure:
                failures.setdefault(str(failure), failure)
            else:
                altered = trial.equilibrium.altered
                return Found(trial, altered, follows_path(strategy), settled=False)
        advice = next(iter(failures.values())).advice
        told = max(
            failures.values(), key=lambda f: (f.quantity != "", f.elements.size > 0)
        )
        raise NoEquilibriumError(
            f"no acceptable state at {goal.load_factor:.6g}: {'; '.join(failures)}",
            told.elements,
            advice if goal.load_factor or advice == LESS_ROUNDING else _AT_REST,
            told.quantity,
        )

    def _trial_by(self, strategy: Strategy, goal: Goal) -> Trial:
        """A state that one strategy finds.

        On the way to a state in which all corners are open none resists: it is shorter.
        """
        problem = self.problem.at(goal.load_factor).holding(goal.held)
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
        parameters, before = equilibrium.parameters, goal.before
        energies, potentials = problem.energies(equilibrium.u, parameters)
        if before:  # one set of parameters for both
            before = before.with_parameters(problem, parameters)
        trial = Trial(problem, equilibrium, before, energies, potentials)
        trial.apply_checks(self.warn_only)
        return trial


def _start_of_another(trial: Trial) -> Start | None:
    """Where the search for another state starts; None if this one is good enough.

    It has the stiffnesses at the state, if they are finite.
    """
    problem, (u, f, parameters, *_) = trial.problem, trial.equilibrium
    if (after := problem.updated(parameters, u)) is parameters:
        return None
    start, tangent = problem.start(u, after, trial.tangent), trial.tangent
    tolerance = trial.equilibrium.tolerance
    if (
        not np.isfinite(start.f).all()
        or problem.unbalanced(start.f, start.u) <= tolerance
    ):
        return None
    if tangent is None or tangent.negative_pivots is None:
        return start
    du, settled = tangent.settled(start.f)
    ours, theirs = (np.array([*problem.reactions(x).values()]) for x in (f, settled))
    force, largest = (np.linalg.norm(x, axis=1).max() for x in (ours - theirs, ours))
    before, end = (sum(x.energies.values()) for x in (trial, start))
    energy = abs(end + (0.5 * start.f + start.load) @ du - before)
    changed = (
        force > _SETTLED * largest + tolerance * u.size
        or energy > _SETTLED * abs(before) + tolerance * np.abs(u).sum()
    )
    return start if changed else None


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
