"""Limits of a load, which no equilibrium near the last one carries more of."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy import ndarray

from ..body import Body, Parameters
from ..problem import Problem
from ..states import NoEquilibriumError, State

# How well a limit load is to be known, as a share of it.  Half of it takes about
# one more halving of a step.
_KNOWN_SHARE = 0.005

# The shortest step on the way to a limit, in load factors.  A longer one may end before
# the limit is known; a shorter one takes more steps, of changes that are round-off.
_SHORTEST_STEP = 1e-9

# Share of the energy of a ply from which loads that grow drive it: half, for the work
# of a load that alone drives a ply is at least the energy.
_DRIVES = 0.5


def moves(problem: Problem, load_factors: Sequence[float]) -> bool:
    """Whether conditions prescribe a motion, or keep nodes on surfaces.

    Raises
    ------
    ValueError
        If a condition has no valid value at one of the load factors.
    """
    values = [problem.constraints.fixed_values(t).any() for t in load_factors]
    return problem.surfaces is not None or any(values)


def loads_drive(
    problem: Problem,
    u: ndarray,
    parameters: Parameters,
    energies: Mapping[str, float],
    moved: bool,
) -> bool:
    """Whether the growth of loads drives a ply, beside displacements and surfaces.

    Parameters
    ----------
    problem
        The problem at the load factor of a state.
    u, parameters, energies
        Displacement, parameters and energies by term of the state.
    moved
        As of `moves`.
    """
    ply, t = problem.ply, problem.load_factor
    if "load" not in ply.roles.values():
        return False
    if not t:  # no displacement yet to compare work
        return not moved
    growth = ply.load(u, t, parameters) - ply.load(u, 0.0, parameters)
    if not moved:
        return bool(growth.any())
    return bool(np.abs(growth * u).sum() > _DRIVES * abs(sum(energies.values())))


def balanced_at_rest(
    problem: Problem, load_factors: Sequence[float], tolerance: float
) -> bool:
    """Whether no load moves the ply at rest at any load factor.

    Parameters
    ----------
    problem
        The problem.
    load_factors
        Load factors of the run.
    tolerance
        Force in N from which on a nodal force counts, be its node held or free.
    """
    rest, p = problem.ply.basis.zeros(), problem.ply.parameters_at_rest
    return all(
        np.abs(problem.at(t).residual(rest, p)).max() <= tolerance for t in load_factors
    )


def load_growth(ply: Body, state: State, beyond: float) -> float:
    """By how much loads grow after a state, over their growth from 0 on.

    Zero where some motion of the state meets no stiffness: whatever the load, it finds
    no balance there.

    Parameters
    ----------
    ply
        The ply.
    state
        The last good state.
    beyond
        The load factor up to which they grow.
    """
    if state.verdict.negative_pivots is None:
        return 0.0
    factors = 0.0, state.load_factor, beyond
    none, least, most = (ply.load(state.u, t, state.parameters) for t in factors)
    largest = max(np.abs(least - none).max(), np.abs(most - none).max())
    return float(np.abs(most - least).max() / largest) if largest else 0.0


def is_known(growth: float, step: float) -> bool:
    """Whether a limit is known well enough.

    Parameters
    ----------
    growth
        Growth of the load, as of `load_growth`, in a step that failed.
    step
        Length of the step.
    """
    return step <= _SHORTEST_STEP or growth <= _KNOWN_SHARE


def limit_error(
    failure: NoEquilibriumError, t: float, beyond: float
) -> NoEquilibriumError:
    """What to say where a load cannot grow from one load factor to another."""
    return NoEquilibriumError(
        f"between the load factors {t:.6g} and {beyond:.6g} the load passes a limit: "
        f"no acceptable state near the last one carries more of it ({failure})",
        failure.elements,
        "displacements in place of the load, or a smaller load",
    )
