"""The terms of a ply, and what they remember of states."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any, TypeAlias

from numpy import ndarray

from ..term import Memory, Role, Term

#: Parameters and work that terms remember at a state, by the names of the terms.
Remembered: TypeAlias = Mapping[str, tuple[dict[str, ndarray], float]]


class RememberingTerms:
    """Terms, and what they remember of states.

    Parameters
    ----------
    terms
        The terms.
    """

    def __init__(self, terms: Sequence[Term]) -> None:
        self._terms = tuple(terms)

    @property
    def terms(self) -> tuple[Term, ...]:
        """Of the fibres, of shear, of corners, of the formulation, and further ones.

        With a memory (`OnePoint` of kind ``rate``) energy, residual and tangent are
        those of a step from the last committed state, and the residual is no derivative
        of the energy.
        """
        return self._terms

    @property
    def roles(self) -> dict[str, Role]:
        """Role of each term, by its name."""
        return {term.name: term.role for term in self.terms}

    @property
    def memories(self) -> dict[str, Memory]:
        """What terms remember, by their names."""
        return {term.name: term.memory for term in self.terms if term.memory}

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged state, for terms that remember one.

        The load stepper does this after each step; a Newton loop of one's own must,
        if the ply has `memories`: with `Macro`, `Quadratic` of mean stretch, and
        `OnePoint` of kind ``rate`` or with the stabilisation ``auto``.

        Returns
        -------
        bool
            Whether that changes the forces at ``u``.
        """
        changed = [memory.commit(u) for memory in self.memories.values()]
        return any(changed)

    def settle(self, u: ndarray, tension: ndarray | None = None) -> bool:
        """Like `commit`, for what depends on the state alone: stiffnesses at ``u``.

        Parameters
        ----------
        u
            Displacement.
        tension
            Fibre tensions that take the place of those at ``u``, as
            `geometric_tension` gives them: away from balance those of stiff fibres are
            far from what they will be.
        """
        changed = []
        for memory in self.memories.values():
            if memory.depends_on == "state":
                takes = getattr(memory, "takes_tension", False)
                given: Any = (u, tension) if takes else (u,)
                changed.append(memory.commit(*given))
        return any(changed)

    @property
    def remembered(self) -> Remembered:
        """Parameters and work of each of the `memories`, by its name; can be set."""
        memories = self.memories.items()
        return {name: (deepcopy(m.parameters), m.work) for name, m in memories}

    @remembered.setter
    def remembered(self, of_state: Remembered) -> None:
        for name, memory in self.memories.items():
            parameters, work = of_state[name]
            memory.restore(deepcopy(parameters), work)

    def reset(self) -> None:
        """Forget every committed state."""
        for memory in self.memories.values():
            memory.begin()
