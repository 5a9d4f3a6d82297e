"""Search for an accepted equilibrium at one load factor."""

import contextlib
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.user_input import real_numbers, refuse_unknown
from ..ply import Ply
from ..ply.parameters import Frozen, PlyParameters
from . import active_set
from .conditions import Conditions, Constraints
from .continuation import MOST_PROJECTED, SHORTER_AFTER_FLIGHT, loads_drive
from .linear import solver_named
from .newton import (
    LESS_ROUNDING,
    METHODS,
    SETTLED,
    Attempt,
    Damped,
    Method,
    balanced,
    balances,
)
from .problem import HOLD, Evaluation, Problem, Tangent
from .states import Equilibrium, Iteration, NoEquilibriumError, State
from .verdict import CHECKS, Trial

_AT_REST = (
    "less tension, compression or load at rest, loads that grow with the load factor, "
    "or more shear stiffness"
)

# Maximum number of repetitions of the iteration at a state with updated parameters.
_MOST_UPDATES = 8

# Shortest relative step in the search for the equilibrium at rest, for a ply that is
# stable there and for one that is not.  With longer steps, heavy cantilevers with
# little bending stiffness are refused; with shorter ones, a refusal takes longer.
_SHORTEST_AT_REST = 2.0**-12, 2.0**-6

# `SETTLED` between tools, so that forces do not depend on the steps by more than 0.1 %:
# with 0.0025 they do by 0.1 % where fibres are very stiff.  Halved updates converge to
# it because the iteration after an update keeps the parameters.
_SETTLED_BETWEEN_TOOLS = 1e-4

# Share of that limit below which the change of nodal forces by a parameter update
# implies, without a linear solve, that the reactions change by less than the limit.
_CERTAINLY = 0.1


class Target(NamedTuple):
    """Target load factor and initial guess.

    Attributes
    ----------
    load_factor, step
        Load factor, and its distance from the last accepted state.
    fixed_values
        Values of the fixed unknowns.
    start, before
        Initial guess, and the last accepted state; None before loading.
    most_projected
        Maximum number of projected tangents.
    propping
        Propping forces, see `Problem`.
    """

    load_factor: float
    step: float
    fixed_values: ndarray
    start: Evaluation
    before: Evaluation | None
    most_projected: float = np.inf
    propping: ndarray | float = 0.0


@dataclass(frozen=True)
class EquilibriumSearch:
    """Nonlinear solver with acceptance checks.

    Attributes
    ----------
    problem, method
        Problem and nonlinear solver.
    warn_only
        Checks of `CHECKS` that warn instead of refusing a state.
    report
        Callback for each iteration.
    """

    problem: Problem
    method: Method
    warn_only: frozenset[str]
    report: Callable[[Iteration], None]

    def __post_init__(self) -> None:
        if self.problem.contacts and not self.method.follows_path:
            raise ValueError(
                f"the method {self.method.name!r} does not find the nodes that touch "
                "tools: use the method 'newton'"
            )

    def __call__(self, target: Target) -> Trial:
        """State that passes all checks, with converged parameters where possible.

        Parameters that would change the state are updated, and equilibrium is restored.
        Updates, except of contact forces, are damped (`Damped`).  Loads that leave the
        supports without reactions are corrected together with the parameters.
        Raises a `NoEquilibriumError` if there is no such state.
        """
        found, damped = self._first(target), Damped()
        most = min(target.most_projected, MOST_PROJECTED)
        limit = _SETTLED_BETWEEN_TOOLS if self.problem.contacts else SETTLED
        target = target._replace(most_projected=most)
        for _ in range(_MOST_UPDATES):
            problem, u, p = found.problem, found.u, found.parameters
            balance = not found.tangent or balances(problem, u, found.f, p)
            closed = not problem.contacts or active_set.is_closed(problem, u, p)
            try:
                with np.errstate(all="ignore"):  # what is not finite is caught
                    after = problem.ply.updated(p, u, target.load_factor)
                    change = 0.0 if after is p else _change(found, after, limit)
                    converged = damped.converges(change, limit)
                    if converged and balance and closed:
                        found.converged = True
                        return found
                    if not converged:
                        of_tools = active_set.of_tools(problem, after)
                        after = Frozen({**damped(p, after, change), **of_tools})
                    if not balance:
                        after = balanced(problem, found.tangent, found.f, after)
                    start = problem.evaluation(u, after, found.tangent)
                    start = replace(start, keeps_parameters=True)
                again = self._first(target._replace(start=start))
            except NoEquilibriumError:
                if not closed:
                    raise
                break
            again.projected = max(found.projected, again.projected)
            found = again
        if not active_set.is_closed(found.problem, found.u, found.parameters):
            raise NoEquilibriumError(
                "the contact forces do not converge", advice="more steps"
            )
        return found

    def at_rest(self, start: Evaluation, values: ndarray) -> Trial:
        """State at load factor 0 of a ply that is not in equilibrium when undeformed.

        Unbalanced forces at rest, such as a constant weight, are first compensated and
        then released in steps, which shrink where convergence is difficult.  Prescribed
        displacements grow with the release to their ``values`` at the load factor
        0. A ply that is unstable at rest may have no such path: the remainder that the
        shortest step cannot release is then released at once, whatever path the
        iteration takes.
        """
        return self._released(start, start.f, lambda share: share * values)

    def freed(self, start: Evaluation, longest: float = 1.0) -> Trial:
        """State at the load factor of a state at which clamps or conditions let go.

        Their forces are released in steps, see `at_rest`; a step releases at most the
        share ``longest`` of them.
        """
        problem = self.problem.at(start.load_factor)
        values = problem.constraints.fixed_values(start.load_factor)
        unbalanced = problem.unfixed(start.f, start.u)
        return self._released(start, unbalanced, lambda share: values, start, longest)

    def _released(
        self,
        start: Evaluation,
        unbalanced: ndarray,
        values: Callable[[float], ndarray],
        before: Evaluation | None = None,
        longest: float = 1.0,
    ) -> Trial:
        """State after forces that balance a start are released, see `freed`.

        ``values`` returns the fixed unknowns at the share that is released, and
        ``before`` is the last accepted state.
        """
        t, u, p, tangent = start.load_factor, start.u, start.parameters, start.tangent
        done, step, most, projected = 0.0, longest, float(MOST_PROJECTED), 0
        stable = tangent is not None and tangent.negative_pivots == 0
        shortest = _SHORTEST_AT_REST[0 if stable else 1]
        while True:
            share = done + step if done + 1.001 * step < 1 else 1.0
            rest = (1.0 - share) * unbalanced
            begin = self.problem.at(t, rest).evaluation(u, p, tangent)
            target = Target(t, 0.0, values(share), begin, before, most, rest)
            try:
                found = self(target)
            except NoEquilibriumError as failure:
                flies = failure.advice == HOLD
                step /= SHORTER_AFTER_FLIGHT if flies else 2
                if step < (_SHORTEST_AT_REST[0] if failure.overload else shortest):
                    if (stable and not before) or most == np.inf or flies:
                        raise
                    step, most = 1.0, np.inf
                continue
            projected = max(projected, found.projected)
            if share == 1.0:
                found.projected = projected
                return found
            last = found.next_start()
            u, p, tangent = last.u, last.parameters, last.tangent
            before = before and last
            done, step = share, min(2 * step, longest)
            if self.problem.let_go(found.parameters, p):
                unbalanced, done, step = last.f + rest, 0.0, longest

    def _first(self, target: Target) -> Trial:
        """Equilibrium, with the initial parameters, that passes all checks.

        If loads drive the path, the ply may jump to another equilibrium; the work check
        is then strict.
        """
        t, step, values, start, before, most, propping = target
        problem, method = self.problem.at(t, propping), self.method
        try:
            with np.errstate(all="ignore"):  # what is not finite is caught
                attempt = Attempt(
                    *(problem, values, most),
                    lambda *done: self.report(Iteration(t, step, method.name, *done)),
                )
                trial = Trial.of(problem, method.solve(attempt, start), before)
                driven = method.follows_path and loads_drive(
                    *(problem, trial.u, trial.parameters, trial.energies)
                )
                trial.apply_checks(self.warn_only - ({"work"} if driven else set()))
        except NoEquilibriumError as failure:
            at_rest = not t and failure.advice not in (LESS_ROUNDING, HOLD)
            raise NoEquilibriumError(
                f"no acceptable state at load factor {t:.6g}: {failure}",
                failure.elements,
                _AT_REST if at_rest else failure.advice,
                failure.quantity,
                failure.overload,
            ) from None
        return trial


def _change(trial: Trial, parameters: PlyParameters, limit: float) -> float:
    """Change of an equilibrium by an update of its parameters.

    It is the larger relative change of energy and forces, to first order; zero if
    within the tolerance of the equilibrium, or certainly below a limit.
    """
    problem, u, f = trial.problem, trial.u, trial.f
    tolerance, tangent = trial.tolerance, trial.tangent
    start = problem.evaluation(u, parameters, tangent)
    if not np.isfinite(start.f).all():
        raise NoEquilibriumError("the parameters of a term are not finite")
    if problem.unbalanced(start.f, u) <= tolerance:
        return 0.0
    before, end = (sum(x.energies.values()) for x in (trial, start))
    largest = _largest_force(trial)
    if abs(end - before) <= limit * abs(before) and (
        np.abs(start.f - f).sum() <= _CERTAINLY * limit * largest
    ):
        return 0.0
    return _change_to_balance(trial, start)


def _change_to_balance(trial: Trial, start: Evaluation) -> float:
    """Change of energy and forces from a trial to the balance of an initial guess.

    To first order, at the same displacement; infinite if the tangent is singular.
    """
    problem, u, f = trial.problem, trial.u, trial.f
    tolerance, tangent = trial.tolerance, trial.tangent
    if tangent is None or tangent.negative_pivots is None:
        return np.inf
    before, end = (sum(x.energies.values()) for x in (trial, start))
    largest = _largest_force(trial)
    ours = np.array([*problem.forces(f).values()])
    du, after = tangent.equilibrated(start.f)
    theirs = np.array([*problem.forces(after).values()])
    force = np.linalg.norm(ours - theirs, axis=1).max() - tolerance * u.size
    energy = abs(end + (0.5 * start.f + start.load) @ du - before)
    energy -= tolerance * np.abs(u).sum()
    of_force = max(force, 0.0) / largest if largest else 0.0
    return float(max(of_force, max(energy, 0.0) / abs(before)))


def _largest_force(trial: Trial) -> float:
    """Largest force of a condition or tool in N."""
    of_tools = (force for force, _ in trial.resultants.values())
    forces = *trial.problem.forces(trial.f).values(), *of_tools
    return max(float(np.linalg.norm(force)) for force in forces)


def method_of(method: str | Method) -> Method:
    """Nonlinear solver, given itself or by name."""
    if isinstance(method, str):
        refuse_unknown("method", method, METHODS)
        return METHODS[method]
    if isinstance(method, type) or not hasattr(method, "solve"):
        raise ValueError(
            f"method must be a nonlinear solver or its name, not {method!r}"
        )
    if method.most < 1:
        raise ValueError(
            f"the maximum number of iterations must be at least 1, got {method}"
        )
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
    """Find and check the equilibrium at a load factor near a displacement.

    There is no previous state, so that its work is not checked.

    Parameters
    ----------
    ply, conditions
        The ply, and its displacement conditions by name.
    u
        Displacement, such as one of the same ply with other laws or loads.
    load_factor
        Load factor.
    parameters
        Initial parameters of the terms, as ``State.parameters``.  Default: those at
        rest, because away from equilibrium the tensions of stiff fibres differ greatly
        from those at equilibrium.
    method, warn_only, solver
        See `LoadStepper`.

    Raises
    ------
    NoEquilibriumError
        If no equilibrium is found, or it is refused.
    ValueError
        If a condition or a name is not valid.
    """
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named(solver)).at(load_factor)
    with np.errstate(all="ignore"):  # what is not finite is caught
        start = problem.evaluation(u, parameters or ply.parameters_at_rest)
    search = EquilibriumSearch(
        problem, method_of(method), frozenset(warn_only), lambda _: None
    )
    values = constraints.fixed_values(load_factor)
    found = search(Target(load_factor, 0.0, values, start, None))
    return found.state(problem.clock.solves)


def state_at(ply: Ply, conditions: Conditions, u: ndarray) -> tuple[State, bool]:
    """State of a displacement at the load factor 1, and whether it is an equilibrium.

    The parameters of the terms are those at rest, updated at the displacement, which
    may change an equilibrium by `SETTLED`.  What a `LoadStepper` would refuse is a
    warning.
    """
    u = real_numbers("u", u)
    ply.refuse_other(u)
    if not np.isfinite(u).all():
        raise ValueError("u must be finite, one displacement in mm for each unknown")
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named("auto")).at(1.0)
    at_rest, tangent = ply.parameters_at_rest, None
    p = ply.updated(at_rest, u)
    f = problem.residual(u, p)
    residual, tolerance = problem.unbalanced(f, u), 0.0
    with contextlib.suppress(NoEquilibriumError):  # a singular tangent
        tangent = Tangent.at(problem, u, p)
        tolerance = tangent.tolerance(u, f, p)
    equilibrium = Equilibrium(u, f, p, (residual,), tolerance, tangent=tangent)
    trial = Trial.of(problem, equilibrium, None)
    fixed = problem.is_fixed(u, constraints.fixed_values(1.0))
    in_balance = fixed and residual <= tolerance
    if fixed and p is not at_rest and np.isfinite(f).all():
        change = _change_to_balance(trial, problem.evaluation(u, p, tangent))
        limit = _SETTLED_BETWEEN_TOOLS if problem.contacts else SETTLED
        in_balance = change <= limit
    if not in_balance:
        cause = f"the largest free nodal force is {residual:.3g} N"
        if not fixed:
            cause = "nodes do not have their prescribed displacements"
        trial.warnings["equilibrium"] = f"not an equilibrium: {cause}"
    try:
        trial.apply_checks(CHECKS)
    except NoEquilibriumError as failure:
        trial.warnings["energy"] = str(failure)
    return trial.state(0), in_balance
