"""Contact with tools: stiffnesses and forces of the augmented Lagrangian.

The nodes that touch are found with a contact stiffness as soft as the ply, which
increments do not overshoot.  With one as stiff as the fibres, each update of the
contact forces then reduces the penetration to a small part, until it is round-off: no
state depends on either stiffness.  The energy of the augmented Lagrangian is convex
normal to the tools, so that its tangent is positive definite if the reduced tangent
is, on the motions along the tools.
"""

import numpy as np
from numpy import ndarray

from ..ply.parameters import Frozen, PlyParameters, Values
from .problem import Problem

#: Penetration and contact force over stiffness, relative to the size of the ply, below
#: which contact is a constraint.
CLOSED = 1e-9

# Smallest stiffness by which forces are divided, in N/mm.
_TINY = 1e-300


def is_set(problem: Problem, parameters: PlyParameters) -> bool:
    """True if the contact stiffnesses of a state have been found."""
    return all(parameters[x.name]["stiffness"].any() for x in problem.contacts)


def soft(
    problem: Problem, u: ndarray, parameters: PlyParameters, tension: ndarray
) -> PlyParameters:
    """Parameters without contact forces, and with a contact as soft as the ply.

    The stiffness is the mean over the nodes of the smallest stiffness of a node, which
    is normal to the ply.  Fibre tensions are arguments of `Ply.stiffness`.
    """
    return _with(problem, parameters, _stiffness(problem, u, parameters, tension)[0])


def stiff(
    problem: Problem, u: ndarray, parameters: PlyParameters, tension: ndarray
) -> PlyParameters:
    """Parameters with the forces of a displacement, and a contact as stiff as fibres.

    The stiffness is the mean over the nodes of the largest stiffness of a node.
    """
    after = problem.ply.updated(parameters, u, problem.load_factor, tension)
    largest = _stiffness(problem, u, parameters, tension)[1]
    forces = {x.name: after[x.name]["force"] for x in problem.contacts}
    return _with(problem, after, largest, forces)


def of_tools(problem: Problem, parameters: PlyParameters) -> dict[str, Values]:
    """Parameters of the contact with tools, by name."""
    return {x.name: parameters[x.name] for x in problem.contacts}


def error(problem: Problem, u: ndarray, parameters: PlyParameters) -> float:
    """Largest penetration, or force without contact over its stiffness, in mm."""
    worst = 0.0
    for contact in problem.contacts:
        p = parameters[contact.name]
        force = contact.forces(u, problem.load_factor, p)
        off = np.abs(force - p["force"]) / np.maximum(p["stiffness"], _TINY)
        worst = max(worst, float(off.max()))
    return worst


def without(problem: Problem, parameters: PlyParameters) -> PlyParameters:
    """Parameters with which tools do not touch the ply."""
    at_rest = of_tools(problem, problem.ply.parameters_at_rest)
    return Frozen({**parameters, **at_rest})


def resultants(
    problem: Problem, u: ndarray, parameters: PlyParameters
) -> dict[str, tuple[ndarray, ndarray]]:
    """Force of each tool on the ply in N, and its travel in mm, shape (3,), by name."""
    t = problem.load_factor
    return {
        x.name: (
            -problem.nodal(x.residual(u, t, parameters[x.name])).sum(axis=1),
            x.travel(t),
        )
        for x in problem.contacts
    }


def _stiffness(
    problem: Problem, u: ndarray, parameters: PlyParameters, tension: ndarray
) -> tuple[float, float]:
    """Mean smallest and largest stiffness of the nodes without contact, in N/mm."""
    ply, bare = problem.ply, without(problem, parameters)
    blocks = ply.stiffness(u, problem.load_factor, bare, tension)
    of_nodes = blocks[ply.pattern.rows == ply.pattern.cols]
    least, _, most = np.linalg.eigvalsh(of_nodes).T
    return float(np.maximum(least, 0.0).mean()), float(most.mean())


def _with(
    problem: Problem,
    parameters: PlyParameters,
    stiffness: float,
    forces: dict[str, ndarray] | None = None,
) -> PlyParameters:
    values = {}
    for contact in problem.contacts:
        n = len(parameters[contact.name]["force"])
        force = np.zeros(n) if forces is None else forces[contact.name]
        stiffnesses = np.full(n, stiffness)
        values[contact.name] = Values({"force": force, "stiffness": stiffnesses})
    return Frozen({**parameters, **values})
