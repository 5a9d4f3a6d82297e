"""Search for the equilibrium at one load factor, and its acceptance checks."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..ply.parameters import PlyParameters
from .conditions import Conditions, Constraints
from .continuation import MOST_ALTERED, loads_drive
from .linear import ChosenSolver
from .newton import LESS_ROUNDING, METHODS, MOST_UPDATES, SETTLED, Method
from .problem import Problem, Start, between
from .states import Iteration, NoEquilibriumError, State
from .verdict import Trial

_AT_REST = (
    "less tension, compression or load at rest, loads that grow with the load factor, "
    "or more shear stiffness"
)

# The shortest step to balance at rest, as a share of what is not balanced: of a ply
# that is stable there, and of another.  With longer ones heavy cantilevers with little
# bending stiffness are refused; with shorter ones a refusal takes longer.
_SHORTEST_AT_REST = 2.0**-12, 2.0**-6

# Share of `SETTLED` below which nodal forces that an update of the parameters changes
# need no linear solve to show that the reactions change by less than `SETTLED`.
_CERTAINLY = 0.1


class Goal(NamedTuple):
    """A load factor to reach, and the initial guess.

    Attributes
    ----------
    load_factor, step
        Load factor, and its distance from the last good state.
    fixed_values
        Values of the fixed unknowns.
    start, before
        Initial guess, and the last good state; None before the load.
    most_altered
        Projected tangents at most.
    held
        Forces beside the loads, as of `Problem`.
    """

    load_factor: float
    step: float
    fixed_values: ndarray
    start: Start
    before: Start | None
    most_altered: float = np.inf
    held: ndarray | float = 0.0


class Found(NamedTuple):
    """A state that passes every check.

    Attributes
    ----------
    trial
        The state.
    altered
        Projected tangents, at most of the iterations that led to it.
    settled
        Whether parameters updated at the state would not change it.
    """

    trial: Trial
    altered: int
    settled: bool


@dataclass(frozen=True)
class EquilibriumSearch:
    """Nonlinear solver and acceptance checks.

    Attributes
    ----------
    problem, method
        The problem of a ply, and the nonlinear solver.
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

    def __call__(self, goal: Goal) -> Found:
        """A state that passes every check, its parameters settled if they can be.

        Parameters that would change the state are updated and the forces balanced
        again.  An update is halved if changes do not shrink by half.  A
        `NoEquilibriumError` says that there is no such state.
        """
        found, share, last = self._first(goal), 1.0, np.inf
        goal = goal._replace(most_altered=min(goal.most_altered, MOST_ALTERED))
        for _ in range(MOST_UPDATES):
            problem, (u, _, p, *_) = found.trial.problem, found.trial.equilibrium
            try:
                with np.errstate(all="ignore"):  # what is not finite is caught
                    after = problem.ply.updated(p, u, goal.load_factor)
                    if after is p:
                        return found._replace(settled=True)
                    start, change = _updated(found.trial, after)
                    # Further changes are a geometric series of this rate.
                    rate = change / last
                    if change <= SETTLED * (1.0 - rate):
                        return found._replace(settled=True)
                    share, last = share if rate <= 0.5 else share / 2, change
                    if share < 1.0:
                        p = between(p, after, share)
                        start = problem.start(u, p, start.tangent)
                again = self._first(goal._replace(start=start))
            except NoEquilibriumError:
                break
            found = again._replace(altered=max(found.altered, again.altered))
        return found

    def at_rest(self, start: Start, fixed_values: ndarray) -> Found:
        """The state at the load factor 0 of a ply that is not in balance there.

        What is not balanced at rest, such as a constant weight, is held at first, and
        let go in steps that shrink where the way is hard.  Prescribed displacements
        grow with it to their ``fixed_values`` at the load factor 0. A ply that is not
        stable at rest may have no path from there: what the shortest step cannot let go
        is then let go at once, by whatever way the iteration takes.
        """
        unbalanced, u, tangent = start.f, start.u, start.tangent
        p = start.parameters
        done, step, most, altered = 0.0, 1.0, float(MOST_ALTERED), 0
        stable = tangent is not None and tangent.negative_pivots == 0
        shortest = _SHORTEST_AT_REST[0 if stable else 1]
        while True:
            share = min(1.0, done + step)
            held = (1.0 - share) * unbalanced
            begin = self.problem.at(0.0, held).start(u, p, tangent)
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
            if share == 1.0:
                return found._replace(altered=altered)
            last = found.trial.next_start()
            u, p, tangent = last.u, last.parameters, last.tangent
            done, step = share, 2 * step

    def _first(self, goal: Goal) -> Found:
        """An equilibrium at the parameters of the start that passes every check.

        Loads that drive a path may jump to another equilibrium: there work must agree.
        """
        problem = self.problem.at(goal.load_factor, goal.held)
        method, place = self.method, (goal.load_factor, goal.step)
        try:
            with np.errstate(all="ignore"):  # what is not finite is caught
                equilibrium = method.solve(
                    *(problem, goal.start, goal.fixed_values, goal.most_altered),
                    lambda *done: self.report(Iteration(*place, method.name, *done)),
                )
                trial = Trial.of(problem, equilibrium, goal.before)
                driven = method.follows_path and loads_drive(
                    problem,
                    equilibrium.u,
                    equilibrium.parameters,
                    trial.energies,
                    self.moved,
                )
                trial.apply_checks(self.warn_only - ({"work"} if driven else set()))
        except NoEquilibriumError as failure:
            at_rest = not goal.load_factor and failure.advice != LESS_ROUNDING
            raise NoEquilibriumError(
                f"no acceptable state at {goal.load_factor:.6g}: {failure}",
                failure.elements,
                _AT_REST if at_rest else failure.advice,
                failure.quantity,
            ) from None
        return Found(trial, equilibrium.altered, settled=False)


def _updated(trial: Trial, parameters: PlyParameters) -> tuple[Start, float]:
    """The equilibrium with updated parameters, and how much the update changes it.

    The change is the larger one of energy and reactions, as a share of these, to first
    order; zero within what the equilibrium leaves unbalanced.
    """
    problem, (u, f, *_) = trial.problem, trial.equilibrium
    tolerance, tangent = trial.equilibrium.tolerance, trial.equilibrium.tangent
    start = problem.start(u, parameters, tangent)
    if not np.isfinite(start.f).all():
        raise NoEquilibriumError("parameters are not finite")
    if problem.unbalanced(start.f, u) <= tolerance:
        return start, 0.0
    before, end = (sum(x.energies.values()) for x in (trial, start))
    ours = np.array([*problem.reactions(f).values()])
    largest = np.linalg.norm(ours, axis=1).max()
    if abs(end - before) <= SETTLED * abs(before) and (
        np.abs(start.f - f).sum() <= _CERTAINLY * SETTLED * largest
    ):
        return start, 0.0
    if tangent is None or tangent.negative_pivots is None:
        return start, np.inf
    du, after = tangent.settled(start.f)
    theirs = np.array([*problem.reactions(after).values()])
    force = np.linalg.norm(ours - theirs, axis=1).max() - tolerance * u.size
    energy = abs(end + (0.5 * start.f + start.load) @ du - before)
    energy -= tolerance * np.abs(u).sum()
    of_force = max(force, 0.0) / largest if largest else 0.0
    return start, float(max(of_force, max(energy, 0.0) / abs(before)))


def method_of(method: str | Method) -> Method:
    """A nonlinear solver, or the one of that name; refused if it is none."""
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


def equilibrium_near(
    ply: Ply,
    conditions: Conditions,
    u: ndarray,
    load_factor: float = 1.0,
    *,
    parameters: PlyParameters | None = None,
    method: str | Method = "newton",
    warn_only: Collection[str] = (),
    solver: str = "auto",
) -> State:
    """Find the state at a load factor that is near a displacement, and judge it.

    There is no step before it, so that its work is not checked.

    Parameters
    ----------
    ply, conditions
        The ply, and its displacement conditions by name.
    u
        The displacement, as `Refinement.carry` makes one.
    load_factor
        Load factor.
    parameters
        Parameters of the ply's terms to start with, as ``State.parameters``; the ones
        at rest if not given: away from balance the tensions of stiff fibres are far
        from the tensions at balance.
    method, warn_only, solver
        As for `LoadStepper`.

    Raises
    ------
    NoEquilibriumError
        If no state is found, or it is refused.
    ValueError
        If a condition or a name is not valid.
    """
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, lambda lower: ChosenSolver(solver, lower)).at(
        load_factor
    )
    with np.errstate(all="ignore"):  # what is not finite is caught
        start = problem.start(u, parameters or ply.parameters_at_rest)
    search = EquilibriumSearch(
        problem, method_of(method), frozenset(warn_only), lambda _: None
    )
    values = constraints.fixed_values(load_factor)
    found = search(Goal(load_factor, 0.0, values, start, None))
    return found.trial.state(problem.clock.solves)
