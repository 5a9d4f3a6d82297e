"""Reactions that the mesh determines poorly: along stiff fibres, or of compressed ones.

Let the discretisation change the energy by e(s), where s is a displacement of a
condition across its motion.  If e has one sign, and a curvature up to the stiffness K
of the ply against s, then |e′| ≤ √(2 K |e|): the error of the reaction along s.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.bases import components, node_dofs
from ..ply import Ply
from .conditions import plain
from .problem import Problem, Tangent
from .states import State

# Ratio of the stiffness across a motion to the load over its length, from which fibres
# provide this stiffness.  Measured: at most 0.3 in bias extension, 7 where fibres are
# inclined by 20° to the motion, and at least 1000 in simple shear along fibres.
_INEXTENSIBLE = 10.0

# Mean compression of a family, relative to G, from which reactions are uncertain: half
# of its fibres at their limit of buckling, the others without tension.  It is 1 to 20
# in simple shear between clamps of fibres inclined by 10° to 30°, and below 0.01 in
# bias extension, in simple shear along fibres and in the scene `strip`.
_BUCKLED = 0.5

# Displacement in mm in the warning.
_EXAMPLE = 0.01


class Uncertain(NamedTuple):
    """Reaction across the motion of a condition: name, half-width in N, and warning."""

    name: str
    half_width: ndarray
    warning: str


def uncertain_reactions(
    problem: Problem, tangent: Tangent, state: State, rate: ndarray, energy_error: float
) -> Iterator[Uncertain]:
    """Reactions along fibres whose error may exceed the component along the motion.

    They are components across the motion of a condition, against which the ply is much
    stiffer than along the motion.

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
        along = v / length
        across = np.array([-along[1], along[0]])
        stiffness = tangent.stiffness(_shift(problem, name, across))
        error = np.sqrt(2 * max(stiffness, 0.0) * energy_error)
        load = abs(along @ state.reactions[name])
        if error > load and stiffness * length > _INEXTENSIBLE * load:
            yield Uncertain(
                name,
                error * np.abs(across),
                f"the reaction of {name!r} across its motion is along nearly "
                f"inextensible fibres and depends on the mesh: {_EXAMPLE:g} mm change "
                f"it by {_EXAMPLE * stiffness:.3g} N; use its component along the "
                f"motion, ({along[0]:.3g}, {along[1]:.3g})",
            )


def compression_warning(ply: Ply, state: State) -> str:
    """Warning that a fibre family in the plane is compressed to buckling, or empty.

    An inextensible net without bending stiffness buckles in its plane where the tension
    is below −G, with the shear stiffness G at rest (Rosen 1965).
    """
    if components(ply.basis) == 3 or any(np.any(D) for D in ply.fabric.bending):
        return ""
    tension, weight = ply.fibre_tension(state.u, state.parameters), ply.basis.dx
    slope = ply.fabric.at().shear_law.tangent(np.zeros((len(weight), 1)))
    T = (tension * weight).sum(axis=(1, 2)).min() / weight.sum()
    G = float((slope * weight).sum() / weight.sum())
    if not 0 < _BUCKLED * G < -T:
        return ""
    return (
        f"fibres are compressed below -G, {-G:.3g} N/mm (smallest tension "
        f"{tension.min():.3g} N/mm, mean of a family {T:.3g} N/mm): without bending "
        "stiffness they buckle in waves as short as the elements, and reactions may "
        "not converge with the mesh; give the fabric a bending stiffness"
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
