"""Whether a state that was read is one of the problem."""

from dataclasses import asdict

import numpy as np
from numpy import ndarray

from ..problem import Equilibrium, Problem, Start
from ..result import State
from ..verdict import Trial
from .contents import SAME

# What round-off leaves of strains and area ratios.
_ROUND_OFF = 1e-13


def check_state(problem: Problem, state: State, before: Start | None) -> None:
    """Compare a state with what the problem makes of its displacement.

    The ply must remember what it did when the state was found.  Counts and residuals
    tell how the state was found, and cannot be compared.

    Parameters
    ----------
    problem
        The problem.
    state
        The state.
    before
        The state before it; None for the first.

    Raises
    ------
    ValueError
        If they disagree.
    """
    u, ply = state.u, problem.ply
    if u.shape != (ply.basis.N,) or u.dtype != float or not np.isfinite(u).all():
        raise ValueError("its displacement is not one of this ply")
    if not problem.is_fixed(u, problem.constraints.fixed_values(state.load_factor)):
        raise ValueError("its displacement is not that of its load factor")
    f, (energies, potentials) = problem.residual(u), problem.energies(u)
    trial = Trial(problem, Equilibrium(u, f, (), state.tolerance), before)
    trial.tangent = None  # a factorisation that tells nothing new
    largest = float(np.abs(f).max())
    rounding = max(state.tolerance - problem.converged * largest, 0.0)
    force = SAME * largest + rounding * u.size
    energy = SAME * sum(map(abs, (*energies.values(), *potentials.values())))
    energy += rounding * float(np.abs(u).sum())
    moved = SAME * float(np.abs(u).max())
    _compare("reactions", state.reactions, problem.reactions(f), force)
    _compare("displacements", state.displacements, problem.displacements(u), moved)
    _compare("energies", state.energies, energies, energy)
    _compare("potentials", state.potentials, potentials, energy)
    ours, theirs = asdict(trial.verdict()), asdict(state.verdict)
    del ours["negative_pivots"], theirs["negative_pivots"]
    work = {"work": ours.pop("work")}, {"work": theirs.pop("work")}
    _compare("work", *work, energy + SAME * sum(map(abs, trial.works)))
    for name, value in ours.items():
        allowed = SAME * abs(value) + _ROUND_OFF
        _compare("verdict", {name: theirs[name]}, {name: value}, allowed)


def _compare(
    name: str,
    told: dict[str, ndarray] | dict[str, float],
    found: dict[str, ndarray] | dict[str, float],
    error: float,
) -> None:
    if list(told) != list(found):
        raise ValueError(f"its {name} are not those of this problem")
    for key, value in found.items():
        off = np.abs(np.subtract(told[key], value))
        if np.shape(told[key]) != np.shape(value) or not np.all(off <= error):
            raise ValueError(f"its {name} are not those of its displacement")


def same(old: ndarray, new: ndarray) -> bool:
    """Whether arrays are those of one problem on two machines; laws may have poles."""
    finite = np.isfinite(new)
    if old.shape != new.shape or not np.array_equal(np.isfinite(old), finite):
        return False
    allowed = SAME * np.abs(new[finite]).max(initial=0.0)
    return bool(np.all(np.abs(old[finite] - new[finite]) <= allowed))
