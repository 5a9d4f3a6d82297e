"""Change of a state by the contact of elements between their nodes.

Nodes lie on a surface, and elements are chords between them; their mean depth is 2/3 of
that at their centres if the curvature is constant.  Elements between tools lie on a
tool on average, and their centres penetrate a convex one.  The ply is pushed out of
tool or surface by 2/3 of the depth of the centre of the deepest element at each node;
the change of the state, from its tangent, estimates the error of contact.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..ply.parameters import PlyParameters
from . import active_set
from .problem import Problem, Tangent
from .states import State

# Mean depth of a bilinear element over the depth at its centre.
_MEAN_DEPTH = 2 / 3

# Updates of the contact forces, each of which reduces the distance from the prescribed
# motion about tenfold.
_UPDATES = 4

#: Relative step of finite differences: of the load factor for rates, and along a motion
#: for derivatives.
STEP = 1e-3


class Response(NamedTuple):
    """Linear response of a state.

    Attributes
    ----------
    motion
        Change of the displacement.
    after
        Change of the nodal forces of supports, in N.
    pushed
        Distance in mm by which each tool pushes nodes outwards, (n_tools, n_nodes).
    """

    motion: ndarray
    after: ndarray
    pushed: ndarray


def pushed_out(problem: Problem, tangent: Tangent, state: State) -> Response:
    """Linear response of a state to pushing the ply out of tools and surfaces."""
    ply, u, t = problem.ply, state.u, state.load_factor
    elements, n_nodes = ply.basis.element_dofs[::3] // 3, len(u) // 3
    centres = element_centres(ply, ply.positions(u))
    inside = [np.maximum(-x.gaps_at(centres, t), 0.0) for x in problem.contacts]
    depths = np.array([_mean_depth(depth, elements, n_nodes) for depth in inside])
    motion = np.zeros_like(u)
    if problem.surfaces:
        away = problem.surfaces.distances(centres, elements, t)
        motion = problem.surfaces.off(u, t, _mean_depth(-away, elements, n_nodes))
    return response(problem, tangent, state, 0.0 * u, motion, depths)


def response(
    problem: Problem,
    tangent: Tangent,
    state: State,
    forces: ndarray,
    motion: ndarray | float = 0.0,
    depths: ndarray | float = 0.0,
) -> Response:
    """Linear response of a state to nodal forces and motions.

    Nodes that touch a tool move off it by its depth, shape (n_tools, n_nodes), or along
    it.
    """
    u, t, p, tools = state.u, state.load_factor, state.parameters, problem.contacts
    touch = np.array([x.forces(u, t, p[x.name]) > 0 for x in tools])
    if not tools:
        moved, after = tangent.response(motion + 0.0 * u, forces)
        return Response(moved, after, touch)
    normals, points = np.array([x.normals(u, t) for x in tools]), tools[0].points
    stiffness = active_set.values(problem, p, "stiffness")
    pushed = target = depths * touch
    for _ in range(_UPDATES):
        on_points = (stiffness * pushed)[:, None] * normals
        of_tools = np.ravel(sum(points.T @ force.T for force in on_points))
        moved, after = tangent.response(motion + 0.0 * u, forces - of_tools)
        found = Response(moved, after, pushed)
        off = (normals * (points @ problem.nodal(moved).T).T).sum(axis=1)
        pushed = pushed + (target - off) * touch
    return found


def element_centres(ply: Ply, x: ndarray) -> ndarray:
    """Positions of the element centres for positions x of the nodes, (3, n)."""
    scalar = ply.basis.elem.elem  # type: ignore[attr-defined]
    shares = [scalar.lbasis(ply.centre, i)[0] for i in range(len(scalar.doflocs))]
    nodes = ply.basis.element_dofs[::3] // 3
    return np.asarray(
        np.einsum("i,ijn->jn", np.ravel(shares), x.T[nodes].swapaxes(1, 2))
    )


def _mean_depth(at_centres: ndarray, elements: ndarray, n_nodes: int) -> ndarray:
    """Mean depth of the deepest element at each node, signed, shape (n_nodes,)."""
    deepest = np.zeros((2, n_nodes))
    for sign, largest in zip((1, -1), deepest, strict=True):
        np.maximum.at(largest, elements, np.tile(sign * at_centres, (len(elements), 1)))
    out, into = deepest
    return _MEAN_DEPTH * np.where(out >= into, out, -into)


def work_of_tools(problem: Problem, u: ndarray, parameters: PlyParameters) -> float:
    """Work of the tools through their motion in N·mm, with the forces at a state.

    Load factor times the derivative of the energy with respect to it, at a fixed
    displacement.
    """
    work, t = 0.0, problem.load_factor
    for tool in problem.contacts:
        p = parameters[tool.name]
        closing = tool.gaps(u, (1 - STEP) * t, p) - tool.gaps(u, t, p)
        force = tool.forces(u, t, p)
        acts = (force > 0) & np.isfinite(closing)
        work += float(force[acts] @ closing[acts]) / STEP
    return work


def changes_of_tools(
    problem: Problem, state: State, response: Response
) -> tuple[float, dict[str, ndarray]]:
    """Change of the work of the tools in N·mm, and of the force of each on the ply.

    Parameters
    ----------
    problem, state
        The problem, and its state.
    response
        Linear response of the state.
    """
    ends = []
    for h in (-STEP, STEP):
        u, p = state.u + h * response.motion, state.parameters
        force, kappa = (
            active_set.values(problem, p, k) for k in ("force", "stiffness")
        )
        moved = force + h * (kappa * response.pushed)
        p = active_set.with_values(problem, p, "force", moved)
        of_tools = active_set.resultants(problem, u, p)
        ends.append((work_of_tools(problem, u, p), of_tools))
    (work, before), (work_after, after) = ends
    over = 2 * STEP
    changes = {name: (after[name][0] - f) / over for name, (f, _) in before.items()}
    return (work_after - work) / over, changes
