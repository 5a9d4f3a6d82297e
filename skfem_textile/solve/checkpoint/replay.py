"""Whether the states that were read are those of the problem, one after the other."""

from dataclasses import asdict, replace

import numpy as np
from numpy import ndarray

from ..problem import Problem, Start
from ..states import Equilibrium, State
from ..verdict import Trial
from .contents import SAME
from .sealed import Content

# What round-off leaves of strains and area ratios.
_ROUND_OFF = 1e-13


class Replay:
    """Finds anew the forces of each state, with what the ply remembered then.

    Called with one state after the other and what its file holds, from the first on.
    At the end the ply's terms remember what the last file holds.

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

    def __call__(self, state: State, content: Content) -> State:
        """Compare a state with what the problem makes of it; give it its shares.

        Raises
        ------
        ValueError
            If they disagree.
        """
        self._restore(content)
        start = None
        if state.load_factor > 0:
            before = self.last.equilibrium.u
            start = self.last.problem.start(before)
        self.last = check_state(self._problem.at(state.load_factor), state, start)
        return replace(state, shares=self.last.shares)

    def _restore(self, content: Content) -> None:
        """Let the ply's terms remember what a file holds."""
        for term, memory in self._problem.ply.memories.items():
            saved = {k: content.arrays[f"{term} {k}"] for k in memory.parameters}
            for name, value in memory.parameters.items():
                old = np.asarray(value)
                if saved[name].shape != old.shape or saved[name].dtype != old.dtype:
                    raise ValueError(f"its {name} is not of this ply")
            memory.restore(saved, content.text["work"][term])


def check_state(problem: Problem, state: State, before: Start | None) -> Trial:
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

    Returns
    -------
    Trial
        What the problem makes of it.

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
    equilibrium = Equilibrium(u, f, (), state.tolerance)
    trial = Trial(problem, equilibrium, before, energies, potentials)
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
