"""Work of reactions and loads: the measure of a load, and of how it changes."""

import numpy as np
from numpy import ndarray

from ..body import Parameters
from ..problem import Problem, turned
from ..states import State

# Length of the step, as a share of the load factor, that tells how conditions move.
_STEP_BACK = 1e-3

# Work over the energy of a ply on a surface from which a load does it.  Nodes that hold
# a ply on a tool of triangles do up to 0.2 % of the energy in work as they follow the
# tool; an edge tension does several times the energy.
_OF_A_LOAD = 0.01

#: Why there is no error of a load.
NO_LOAD = "nothing that moves carries a load"


def work(problem: Problem, f: ndarray, u: ndarray, parameters: Parameters) -> ndarray:
    """Work of reactions in the motion of their conditions, and of loads, in N·mm.

    Each node of a condition counts with its own motion: an edge may turn.

    Parameters
    ----------
    problem
        The problem at its load factor.
    f, u, parameters
        Nodal forces, displacement and parameters of the terms.
    """
    constraints = problem.constraints
    moving = turned(f, constraints.turn)[constraints.prescribed]
    of_reactions = moving @ _rate(problem)
    return np.array([of_reactions, problem.load(u, parameters) @ u])


def work_of(problem: Problem, state: State) -> ndarray:
    """The work at a state.

    Raises
    ------
    ValueError
        If nothing that moves carries a load.
    """
    u, p = state.u, state.parameters
    found = work(problem, problem.residual(u, p), u, p)
    if not carries_load(found, problem, state):
        raise ValueError(NO_LOAD)
    return found


def change_of(before: ndarray, after: ndarray) -> float:
    """Change of the work, as a share of what it was."""
    return float(np.abs((after - before).sum()) / np.abs(before).sum())


def carries_load(found: ndarray, problem: Problem, state: State) -> bool:
    """Whether work is more than forces do that a state leaves unbalanced.

    On a surface, which shapes the ply as it grows, it is more than that of supports.
    """
    length = np.abs(state.u).sum() + np.abs(_rate(problem)).sum()
    least = state.tolerance * length
    if problem.surfaces is not None:
        least = max(least, _OF_A_LOAD * abs(sum(state.energies.values())))
    return bool(np.abs(found).sum() > least)


def _rate(problem: Problem) -> ndarray:
    """How fixed unknowns move with the load factor, times the load factor, in mm."""
    constraints, t = problem.constraints, problem.load_factor
    now, before = (constraints.fixed_values(x) for x in (t, (1 - _STEP_BACK) * t))
    return (now - before) / _STEP_BACK
