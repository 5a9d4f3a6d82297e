"""Limits of a load, which no equilibrium near the last one carries more of."""

from collections.abc import Sequence

import numpy as np

from ..body import PROBED, Body
from ..problem import Problem
from ..states import NoEquilibriumError, State

# How well a limit load is to be known, as a share of it.  Half of it takes about
# one more halving of a step.
_KNOWN_SHARE = 0.005

# The shortest step on the way to a limit, in load factors.  A longer one may end before
# the limit is known; a shorter one takes more steps, of changes that are round-off.
_SHORTEST_STEP = 1e-9

# Share of the element size by which nodes are moved to see what loads depend on: small
# against elements, large against round-off.
_PROBE = 1e-3


def loads_grow(ply: Body, load_factors: Sequence[float]) -> bool:
    """Whether the load factor drives loads, and not only displacements.

    Parameters
    ----------
    ply
        The ply.
    load_factors
        Load factors of the run.
    """
    if "load" not in ply.roles.values():
        return False
    direction = np.random.default_rng(0).uniform(-1.0, 1.0, ply.basis.N)
    u = _PROBE * ply.element_size * direction  # some loads depend on it
    at_rest = ply.load(u, 0.0)
    return any(
        not np.array_equal(ply.load(u, t), at_rest) for t in (*PROBED, *load_factors)
    )


def nothing_drives(
    problem: Problem, load_factors: Sequence[float], tolerance: float
) -> bool:
    """Whether the ply at rest is in equilibrium at every load factor.

    Parameters
    ----------
    problem
        The problem.
    load_factors
        Load factors of the run.
    tolerance
        Force in N from which on a nodal force counts, be its node held or free.
    """
    if problem.surfaces or any(
        np.any(problem.constraints.fixed_values(t)) for t in load_factors
    ):
        return False
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
