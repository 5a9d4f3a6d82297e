"""Work of reactions and loads: the measure of a load, and of how it changes."""

import numpy as np
from numpy import ndarray

from ..problem import Problem, turned
from ..states import State

# Length of the step, as a share of the load factor, that tells how conditions move.
_STEP_BACK = 1e-3


def work(problem: Problem, f: ndarray, u: ndarray) -> ndarray:
    """Work of reactions in the motion of their conditions, and of loads, in N·mm.

    Each node of a condition counts with its own motion: an edge may turn.

    Parameters
    ----------
    problem
        The problem at its load factor.
    f, u
        Nodal forces and displacement.
    """
    constraints = problem.constraints
    moving = turned(f, constraints.turn)[constraints.prescribed]
    of_reactions = moving @ _rate(problem)
    return np.array([of_reactions, problem.load(u) @ u])


def work_of(problem: Problem, state: State) -> ndarray:
    """The work at a state, with the stiffnesses that the ply holds.

    Raises
    ------
    ValueError
        If nothing that moves carries a load.
    """
    found = work(problem, problem.residual(state.u), state.u)
    refuse_round_off(found, problem, state)
    return found


def change_of(before: ndarray, after: ndarray) -> float:
    """Change of the work, as a share of what it was."""
    return float(np.abs((after - before).sum()) / np.abs(before).sum())


def refuse_round_off(found: ndarray, problem: Problem, state: State) -> None:
    """Refuse work that is none but for the forces that a state leaves unbalanced.

    Raises
    ------
    ValueError
        If it is.
    """
    length = np.abs(state.u).sum() + np.abs(_rate(problem)).sum()
    if not np.abs(found).sum() > state.tolerance * length:
        raise ValueError("nothing that moves carries a load")


def _rate(problem: Problem) -> ndarray:
    """How fixed unknowns move with the load factor, times the load factor, in mm."""
    constraints, t = problem.constraints, problem.load_factor
    now, before = (constraints.fixed_values(x) for x in (t, (1 - _STEP_BACK) * t))
    return (now - before) / _STEP_BACK
