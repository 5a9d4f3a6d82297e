"""Reactions that the mesh determines poorly: along stiff fibres, or of compressed ones.

Let the discretisation change the energy by e(s), where s is a displacement of a
condition across its motion.  If e has one sign, and a curvature up to the stiffness K
of the ply against s, then |e′| ≤ √(2 K |e|): the error of the reaction along s.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.bases import node_dofs
from ..ply import Ply
from .conditions import plain
from .problem import Problem, Tangent
from .states import State

# Displacement in mm in the warning.
_EXAMPLE = 0.01


class Uncertain(NamedTuple):
    """Reaction across the motion of a condition: its name, half-width in N, warning."""

    name: str
    half_width: ndarray
    warning: str


def uncertain_reactions(
    problem: Problem, tangent: Tangent, state: State, rate: ndarray, energy_error: float
) -> Iterator[Uncertain]:
    """Reactions whose component across the motion may be off by the whole reaction.

    Parameters
    ----------
    problem, tangent
        A ply in the plane, and its tangent at the state.
    state
        The state.
    rate
        Motion of the prescribed unknowns in mm.
    energy_error
        Error of the work of the reactions in N·mm, an upper bound of the error of the
        energy.
    """
    for name, v in _relative_motions(problem, rate).items():
        length = np.hypot(*v)
        if not length > 0:
            continue
        across = np.array([-v[1], v[0]]) / length
        stiffness = tangent.stiffness(_shift(problem, name, across))
        error = np.sqrt(2 * max(stiffness, 0.0) * energy_error)
        if error > np.hypot(*state.reactions[name]):
            yield Uncertain(
                name,
                error * np.abs(across),
                f"the reaction of {name!r} across its motion, along nearly "
                f"inextensible fibres, depends on the mesh: {_EXAMPLE:g} mm change it "
                f"by {_EXAMPLE * stiffness:.3g} N; use its component along the motion, "
                f"({v[0] / length:.3g}, {v[1] / length:.3g})",
            )


def _relative_motions(problem: Problem, rate: ndarray) -> dict[str, ndarray]:
    """Mean motion of each condition, relative to the mean of the others, shape (2,)."""
    constraints = problem.constraints
    q = np.zeros(problem.ply.basis.N)
    q[constraints.prescribed] = rate
    u = problem.nodal(plain(q, constraints.turn))
    motion = {name: u[:, k].mean(axis=1) for name, k in constraints.nodes.items()}
    total, others = sum(motion.values()), max(len(motion) - 1, 1)
    return {name: v - (total - v) / others for name, v in motion.items()}


def _shift(problem: Problem, name: str, direction: ndarray) -> ndarray:
    """Unit displacement of a condition, along the directions that it fixes."""
    dofs, u = node_dofs(problem.ply.basis), np.zeros(problem.ply.basis.N)
    for of, nodes, n in problem.constraints.fixed_directions:
        if of == name:
            u[dofs[:, nodes]] += n * (direction @ n)
    return u
