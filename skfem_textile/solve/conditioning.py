"""Reactions that the mesh determines poorly: along stiff fibres, or of compressed ones.

Fibres that are compressed below −G and have no bending stiffness buckle in waves as
short as the elements.  Let the discretisation change the energy by e(s), where s is a
displacement of a condition across its motion.  If e has one sign, and a curvature up to
the stiffness K of the ply against s, then |e′| ≤ √(2 K |e|): the error of the reaction
along s.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.bases import components, element_numbers, node_dofs
from ..ply import Ply
from .conditions import plain
from .problem import Problem, Tangent
from .states import State

# Ratio of the stiffness across a motion to the load over its length, from which fibres
# provide this stiffness.  Measured: at most 0.3 in bias extension, 7 where fibres are
# inclined by 20° to the motion, and at least 1000 in simple shear along fibres.
_INEXTENSIBLE = 10.0

# Mean compression of a family, relative to G, from which loads are uncertain: half of
# its fibres at their limit of buckling, the others without tension.  It is 1 to 20 in
# simple shear between clamps of fibres inclined by 10° to 30°, and below 0.01 in bias
# extension, in simple shear along fibres and in the scene `strip`.
_BUCKLED = 0.5

# Shortening of fibres without resistance to compression, and share of the area in which
# a family shortens more, from which loads are uncertain.  The share is 0.3 to 0.7 in
# simple shear whose load does not converge, and below 0.03 in other plies.
_SLACK, _MOSTLY_SLACK = 1e-3, 0.2

# Share of the energy in bending within layers narrower than elements, from which loads
# are uncertain.  It is 0.3 to 0.4 where they double from 6 to 16 elements across, and
# below 0.15 where they converge: simple shear of fibres inclined by 45° and 20°.
_KINKED = 0.2

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
    stiffer than along the motion, if fibres without bending stiffness are compressed
    below −G somewhere.  Otherwise the change with the numerical stiffness is the error.

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
    ply, rest = problem.ply, np.zeros(problem.ply.basis.dx.shape)
    tension = ply.fibre_tension(state.u, state.parameters)
    G = ply.fabric.at(element_numbers(ply.basis)[:, :1]).shear_law.tangent(rest)
    if ply.fabric.bends or not (tension < -np.asarray(G)).any():
        return
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
                f"motion, ({along[0]:.3g}, {along[1]:.3g}), or give the fabric a "
                "bending stiffness: without it, compressed fibres buckle",
            )


def buckling_warning(ply: Ply, state: State) -> str:
    """Warning that fibres in the plane buckle or bend within elements, or empty.

    An inextensible net without bending stiffness buckles in its plane where the tension
    is below −G, with the shear stiffness G at rest (Rosen 1965).  Fibres without
    resistance to compression buckle where they shorten.  Fibres with the bending
    stiffness D and the tension T bend within layers of the width √(D/(G + |T|)).
    """
    if components(ply.basis) == 3:
        return ""
    tension, weight = ply.fibre_tension(state.u, state.parameters), ply.basis.dx
    cells = element_numbers(ply.basis)[:, :1]
    fabric, area = ply.fabric.at(cells), weight.sum()
    slope = fabric.shear_law.tangent(np.zeros(cells.shape))
    G = float((slope * weight).sum() / area)
    if ply.fabric.bends:
        bent = state.energies.get("bending", 0.0) / sum(state.energies.values())
        most = float((np.abs(tension).max(axis=0) * weight).sum() / area)
        of_layers = sum(map(np.mean, ply.fabric.bending_at_rest))
        narrow = 0.5 * of_layers < weight.sum(axis=1).mean() * (G + most)
        if bent <= _KINKED or not narrow:
            return ""
        return (
            f"{100 * bent:.0f} % of the energy are in bending within layers that are "
            "narrower than the elements, and reactions do not converge with the mesh: "
            "refine the mesh, or apply a tension across the compressed fibres"
        )
    T = (tension * weight).sum(axis=(1, 2)).min() / area
    strain = ply.law_strain(state.u).mean(axis=2)
    resists = np.asarray(fabric.tensions.value(strain[..., None]))[..., 0] != 0
    slack = ((strain < -_SLACK) & ~resists) * weight.sum(axis=1)
    if not (0 < _BUCKLED * G < -T or slack.sum(axis=1).max() > _MOSTLY_SLACK * area):
        return ""
    return (
        f"fibres are slack or compressed below -G, {-G:.3g} N/mm (smallest tension "
        f"{tension.min():.3g} N/mm, mean of a family {T:.3g} N/mm): without bending "
        "stiffness they buckle in waves as short as the elements, and reactions do not "
        "converge with the mesh; give the fabric a bending stiffness, or apply a "
        "tension along these fibres"
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
