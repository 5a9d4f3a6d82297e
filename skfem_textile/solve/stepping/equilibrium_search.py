"""The search for a state at one load factor."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..body import Parameters
from ..newton import LESS_ROUNDING, METHODS, MOST_UPDATES, SETTLED, Method
from ..problem import Goal, Problem, Start
from ..states import Equilibrium, Iteration, NoEquilibriumError
from ..verdict import Trial
from .limit import loads_drive
from .load_path import MOST_ALTERED

_AT_REST = (
    "less tension, compression or load at rest, loads that grow with the load factor, "
    "or more shear stiffness"
)

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
    """

    trial: Trial
    altered: int
    followed_path: bool
    settled: bool


@dataclass(frozen=True)
class EquilibriumSearch:
    """Nonlinear solver and acceptance checks.

    Attributes
    ----------
    problem, method
        Problem and nonlinear solver.
    warn_only
        Checks of `CHECKS` that do not refuse a state but only warn.
    report
        Called with each iteration.
    moved
        Whether conditions prescribe a motion, see `moves`.
    """

    problem: Problem
    method: Method
    warn_only: frozenset[str]
    report: Callable[[Iteration], None]
    moved: bool = True

    def loads_drive(self, at: Start) -> bool:
        """Whether loads drive the steps from a state, and a path of theirs is followed.

        They may jump to another equilibrium: there work must agree.
        """
        if not self.method.follows_path:
            return False
        place = at.u, at.parameters, at.energies
        return loads_drive(self.problem.at(at.load_factor), *place, self.moved)

    def __call__(self, goal: Goal) -> Found:
        """A state that passes every check, its parameters settled if they can be.

        Parameters that would change the state are updated and the forces balanced
        again.  An update is halved if changes do not shrink by half.

        Raises
        ------
        NoEquilibriumError
            If there is none.
        """
        found, share, last = self._first(goal), 1.0, np.inf
        # The way from one to the next is easy.
        goal = goal._replace(most_altered=min(goal.most_altered, MOST_ALTERED))
        for _ in range(MOST_UPDATES):
            with np.errstate(all="ignore"):  # what is not finite is caught
                after, change = _update(found.trial)
                if change <= SETTLED:
                    found = found._replace(settled=True)
                    break
                share, last = share if change <= last / 2 else share / 2, change
                start = found.trial.start_with(after, share)
            try:
                again = self._first(goal._replace(start=start))
            except NoEquilibriumError:
                break
            found = again._replace(
                altered=max(found.altered, again.altered),
                followed_path=found.followed_path and again.followed_path,
            )
        return found

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
        """An equilibrium at the parameters of the start that passes every check.

        Raises
        ------
        NoEquilibriumError
            If there is none.
        """
        problem = self.problem.at(goal.load_factor).holding(goal.held)
        method, place = self.method, (goal.load_factor, goal.step)

        def report(*iteration: Any) -> None:
            self.report(Iteration(*place, method.name, *iteration))

        try:
            with np.errstate(all="ignore"):  # what is not finite is caught
                equilibrium = method.solve(
                    problem, goal.start, goal.fixed_values, goal.most_altered, report
                )
                trial = self._checked(problem, equilibrium, goal)
        except NoEquilibriumError as failure:
            at_rest = not goal.load_factor and failure.advice != LESS_ROUNDING
            raise NoEquilibriumError(
                f"no acceptable state at {goal.load_factor:.6g}: {failure}",
                failure.elements,
                _AT_REST if at_rest else failure.advice,
                failure.quantity,
            ) from None
        return Found(trial, equilibrium.altered, method.follows_path, settled=False)

    def _checked(self, problem: Problem, equilibrium: Equilibrium, goal: Goal) -> Trial:
        """The trial of an equilibrium that passes every check."""
        parameters, before = equilibrium.parameters, goal.before
        energies, potentials = problem.energies(equilibrium.u, parameters)
        if before:  # one set of parameters for both
            before = before.with_parameters(problem, parameters)
        trial = Trial(problem, equilibrium, before, energies, potentials)
        place = equilibrium.u, parameters, energies
        if self.method.follows_path and loads_drive(problem, *place, self.moved):
            trial.apply_checks(self.warn_only - {"work"})
        else:
            trial.apply_checks(self.warn_only)
        return trial


def _update(trial: Trial) -> tuple[Parameters, float]:
    """Parameters updated at an equilibrium, and how much that changes it.

    The change is the larger one of energy and reactions, as a share of these, to first
    order; zero within what the equilibrium leaves unbalanced.
    """
    problem, (u, f, parameters, *_) = trial.problem, trial.equilibrium
    if (after := problem.updated(parameters, u)) is parameters:
        return after, 0.0
    start, tangent = problem.start(u, after, trial.tangent), trial.tangent
    tolerance = trial.equilibrium.tolerance
    if not np.isfinite(start.f).all():
        raise NoEquilibriumError("parameters are not finite")
    if problem.unbalanced(start.f, start.u) <= tolerance:
        return after, 0.0
    largest = max(np.linalg.norm(x) for x in problem.reactions(f).values())
    before, end = (sum(x.energies.values()) for x in (trial, start))
    at_once = abs(end - before) <= SETTLED * abs(before)
    if at_once and np.abs(start.f - f).sum() <= 0.1 * SETTLED * largest:
        return after, 0.0
    if tangent is None or tangent.negative_pivots is None:
        return after, np.inf
    du, settled = tangent.settled(start.f)
    ours, theirs = (np.array([*problem.reactions(x).values()]) for x in (f, settled))
    force, largest = (np.linalg.norm(x, axis=1).max() for x in (ours - theirs, ours))
    before, end = (sum(x.energies.values()) for x in (trial, start))
    energy = abs(end + (0.5 * start.f + start.load) @ du - before)
    of_force = max(force - tolerance * u.size, 0.0) / largest if largest else 0.0
    of_energy = max(energy - tolerance * np.abs(u).sum(), 0.0) / abs(before)
    return after, float(max(of_force, of_energy))


def method_of(method: str | Method) -> Method:
    """A nonlinear solver, or the one of that name.

    Raises
    ------
    ValueError
        If there is none, or it is allowed no iteration.
    """
    if isinstance(method, str):
        if method not in METHODS:
            raise ValueError(
                f"unknown method {method!r}: choose of {', '.join(METHODS)}"
            )
        return METHODS[method]
    if isinstance(method, type) or not hasattr(method, "solve"):
        raise ValueError(f"{method!r} is neither a nonlinear solver nor its name")
    if method.most < 1:
        raise ValueError(f"{method} must be allowed at least one iteration")
    return method
