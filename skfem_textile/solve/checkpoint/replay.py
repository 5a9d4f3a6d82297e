"""Validation of the states of a checkpoint against the problem."""

from dataclasses import asdict, replace

import numpy as np
from numpy import ndarray

from ..problem import Problem, Start
from ..states import Equilibrium, State
from ..verdict import Trial
from .contents import SAME

# What round-off leaves of strains and area ratios.
_ROUND_OFF = 1e-13


class Replay:
    """Checks of states that were read, one after the other from the first on.

    Parameters
    ----------
    problem
        The problem that is run.

    Attributes
    ----------
    last
        What the problem makes of the last state.
    """

    last: Trial

    def __init__(self, problem: Problem) -> None:
        self._problem = problem

    def __call__(self, state: State) -> State:
        """Compare a state with what the problem makes of it; give it its shares.

        Raises
        ------
        ValueError
            If they disagree.
        """
        start = None
        if state.load_factor > 0:
            start = self.last.next_start()
            start = start.with_parameters(self.last.problem, state.parameters)
        self.last = check_state(self._problem.at(state.load_factor), state, start)
        return replace(state, shares=self.last.shares)


def check_state(problem: Problem, state: State, before: Start | None) -> Trial:
    """Compare a state with what the problem makes of its displacement.

    Counts and residuals are not compared: they depend on how the state was found.

    Parameters
    ----------
    problem
        The problem.
    state
        The state.
    before
        The state before it; None for the first.

    Returns
    -------
    Trial
        What the problem makes of it.

    Raises
    ------
    ValueError
        If they disagree.
    """
    u, ply, p = state.u, problem.ply, state.parameters
    if u.shape != (ply.basis.N,) or u.dtype != float or not np.isfinite(u).all():
        raise ValueError("its displacement is not one of this ply")
    if not problem.is_fixed(u, problem.constraints.fixed_values(state.load_factor)):
        raise ValueError("its displacement is not that of its load factor")
    f, (energies, potentials) = problem.residual(u, p), problem.energies(u, p)
    equilibrium = Equilibrium(u, f, p, (), state.tolerance)
    trial = Trial(problem, equilibrium, before, energies, potentials)
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
    return trial


def _compare(
    name: str,
    saved: dict[str, ndarray] | dict[str, float],
    expected: dict[str, ndarray] | dict[str, float],
    error: float,
) -> None:
    if list(saved) != list(expected):
        raise ValueError(f"its {name} are not those of this problem")
    for key, value in expected.items():
        off = np.abs(np.subtract(saved[key], value))
        if np.shape(saved[key]) != np.shape(value) or not np.all(off <= error):
            raise ValueError(f"its {name} are not those of its displacement")
