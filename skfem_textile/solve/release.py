"""Conditions that end during a run, and the forces that take their place.

The forces of a condition on the ply at its end become loads, which decrease in
proportion to the load factor and vanish at 1.  The nodes of the condition are free, so
that the ply springs back in steps, each of which is an equilibrium.
"""

from bisect import bisect_left
from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from .conditions import Condition, Conditions, Constraints, reactions

# Distance of an end from a load factor within which they are the same: round-off.
_SAME = 1e-9


def release_of(
    basis: CellBasis, conditions: Conditions, load_factors: Sequence[float]
) -> "Release | None":
    """The ends of conditions before the load factor 1; None if there are none.

    Raises
    ------
    ValueError
        If an end is not a load factor of a step, or no condition remains.
    """
    ends: dict[float, list[str]] = {}
    for name, condition in conditions.items():
        if not isinstance(condition, Condition) or condition.until >= 1:
            continue
        near = min(load_factors, key=lambda t: abs(t - condition.until))
        if abs(near - condition.until) > _SAME:
            raise ValueError(
                f"condition {name!r} ends at the load factor {condition.until:g}, "
                f"within a step: choose steps such that one ends there, or {near:g}"
            )
        ends.setdefault(near, []).append(name)
    return Release(basis, conditions, ends) if ends else None


class Release:
    """Phases of a run, in each of which other conditions act.

    Parameters
    ----------
    basis
        Basis of the displacement.
    conditions
        All conditions.
    ends
        Names of the conditions that end, by load factor.
    """

    def __init__(
        self, basis: CellBasis, conditions: Conditions, ends: dict[float, list[str]]
    ) -> None:
        self.ends, left = sorted(ends), dict(conditions)
        self.constraints = [Constraints(basis, conditions)]
        for end in self.ends:
            for name in ends[end]:
                del left[name]
            if not left:
                raise ValueError(
                    f"no condition remains beyond the load factor {end:g}: hold the "
                    "ply against motions without deformation, such as at two nodes"
                )
            after = Constraints(basis, left)
            after.nodes = self.constraints[0].nodes  # which are still reported
            self.constraints.append(after)
        self._forces: dict[int, ndarray] = {}
        self._systems: dict[int, Any] = {}

    def phase(self, t: float) -> int:
        """Number of ends before a load factor."""
        return bisect_left(self.ends, t)

    def ends_at(self, t: float) -> bool:
        """True if conditions end at a load factor."""
        return t in self.ends

    def forces(self, phase: int, t: float) -> ndarray | float:
        """Remaining nodal forces of the conditions that ended before a phase in N."""
        shares = [(1 - t) / (1 - end) for end in self.ends[:phase]]
        return sum(share * self._forces[k] for k, share in enumerate(shares)) + 0.0

    def enter(self, problem: Any, phase: int) -> None:
        """Let the conditions of a phase act in a problem, and the remaining forces."""
        problem.constraints = self.constraints[phase]
        vars(problem).pop("system", None)
        if phase in self._systems:
            vars(problem)["system"] = self._systems[phase]
        else:
            self._systems[phase] = problem.system
        problem.remaining = self.forces(phase, problem.load_factor)
        problem.propping = problem.propping + problem.remaining

    def refuse_tools(self, problem: Any) -> None:
        """Refuse conditions that end if a ply is on or between tools."""
        if problem.contacts or problem.surfaces:
            raise ValueError(
                "until: conditions of a ply on or between tools cannot end before the "
                "load factor 1: give the tools rows of motions"
            )

    def reactions(
        self, problem: Any, found: dict[str, ndarray], u: ndarray
    ) -> dict[str, ndarray]:
        """Reactions by condition, with the remaining forces of those that ended."""
        if not np.any(problem.remaining):
            return found
        forces = problem.nodal(np.asarray(problem.remaining))
        first = reactions(self.constraints[0], forces, u, problem.load_factor)
        return {name: force + first[name] for name, force in found.items()}

    def end(self, problem: Any, f: ndarray, u: ndarray) -> Any:
        """The problem in which forces replace the conditions that end there.

        Parameters
        ----------
        problem
            The problem, in whose phase they still act.
        f, u
            Nodal forces and displacement of its state.
        """
        phase, after = self.phase(problem.load_factor), copy(problem)
        after.constraints = self.constraints[phase + 1]
        self._forces[phase] = after.unfixed(f, u)
        after.propping = after.propping - problem.remaining
        self.enter(after, phase + 1)
        return after
