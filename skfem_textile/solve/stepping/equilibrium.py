"""A state at one load factor, from a displacement that is near it."""

from collections.abc import Collection

import numpy as np
from numpy import ndarray

from ..body import Body, Parameters
from ..conditions import Conditions, Constraints
from ..linear import ChosenSolver
from ..newton import Method
from ..problem import Problem
from ..states import State
from .equilibrium_search import EquilibriumSearch, Goal, method_of


def equilibrium_near(
    ply: Body,
    conditions: Conditions,
    u: ndarray,
    load_factor: float = 1.0,
    *,
    parameters: Parameters | None = None,
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
        Parameters of the ply's terms to start with, as ``State.parameters``; those at
        rest if not given: away from balance the tensions of stiff fibres are far from
        those at balance.
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
    return found.trial.state(load_factor, problem.clock.solves)
