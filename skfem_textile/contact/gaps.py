"""Contact of a formed ply with its tools: gaps between nodes, pressure, fillets."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..solve.between_nodes import element_centres
from ..solve.states import State
from .obstacle import ToolContact, ToolTerm
from .risks import NO_FORCE, largest_turn, pressure_of


class SmallestGap(NamedTuple):
    """Smallest gap in mm, negative inside the tool, its place and an element there."""

    gap: float
    place: ndarray
    element: int


def smallest_gap(
    ply: Ply, contact: ToolContact, u: ndarray, t: float
) -> SmallestGap | None:
    """Smallest gap at all nodes, edge midpoints and element centres of a ply.

    Elements lie on the tool on average: their centres may penetrate it, or nodes where
    it is concave.  None if the tool does not reach the ply.

    Parameters
    ----------
    ply
        The ply.
    contact
        One of its `contacts`.
    u, t
        Displacement and load factor of a `State`.
    """
    mesh, n = ply.mesh, ply.mesh.nvertices
    x = ply.positions(u)
    vertices, midpoints = x[:, :n], x[:, n:]
    if not midpoints.size:
        midpoints = vertices[:, mesh.facets].mean(axis=1)
    centres = element_centres(ply, x)
    of_vertices = np.zeros(n, dtype=int)
    of_vertices[mesh.t] = np.arange(mesh.nelements)
    elements = np.concatenate([of_vertices, mesh.f2t[0], np.arange(mesh.nelements)])
    points = np.hstack([vertices, midpoints, centres])
    gap = contact.gaps_at(points, t)
    least = int(gap.argmin())
    if not np.isfinite(gap[least]):
        return None
    return SmallestGap(float(gap[least]), points[:, least], int(elements[least]))


def tool_force(ply: Ply, tool: ToolTerm, state: State) -> ndarray:
    """Force of a tool or holder on a ply in N, shape (3,).

    Parameters as in `tool_pressure`.
    """
    _refuse_other(tool, state)
    if isinstance(tool, ToolContact):
        return state.reactions[tool.name]
    u, t, parameters = state.u, state.load_factor, state.parameters[tool.name]
    return np.asarray(-ply.nodal(tool.residual(u, t, parameters)).sum(axis=1))


def tool_pressure(ply: Ply, tool: ToolTerm, state: State) -> ndarray:
    """Pressure of a tool or holder on the nodes of a ply, in N/mm² of current area.

    Parameters
    ----------
    ply
        The ply.
    tool
        One of those `pressing` on it.
    state
        State of the ply.

    Returns
    -------
    ndarray
        Shape (n_nodes,).  It is linear between the corners of the user's elements, and
        work-equivalent to the contact forces, see `drape.contact_pressure`.
    """
    force = _forces(tool, state)
    if isinstance(tool, ToolContact):
        force = np.maximum(tool.points.T @ force, 0.0)
    return pressure_of(ply, state.u, force)


def touching(ply: Ply, contact: ToolContact, state: State) -> ndarray:
    """Elements with a node that a tool presses on: bool, shape (n_elements,).

    Parameters as in `turn_on_tool`.
    """
    nodes = ply.basis.element_dofs[::3] // 3
    return np.asarray(_in_contact(contact, state)[nodes].any(axis=0))


def nodes_in_contact(tool: ToolTerm, state: State) -> int:
    """Number of nodes on which a tool or holder presses.

    Parameters as in `tool_pressure`.
    """
    return int(_in_contact(tool, state).sum())


def _in_contact(tool: ToolTerm, state: State) -> ndarray:
    """Nodes on which a tool or holder presses: bool, shape (n_nodes,)."""
    force = _forces(tool, state)
    return np.asarray(force > NO_FORCE * force.max())


def _forces(tool: ToolTerm, state: State) -> ndarray:
    """Normal forces on the contact points of nodes in N, shape (n_nodes,)."""
    _refuse_other(tool, state)
    return tool.forces(state.u, state.load_factor, state.parameters[tool.name])


def _refuse_other(tool: ToolTerm, state: State) -> None:
    """Refuse a state of a ply without the tool, or of another mesh."""
    if tool.name not in state.parameters or state.u.size != 3 * tool.nodes.shape[1]:
        raise ValueError(
            f"the state is of another ply than the tool {tool.name!r}: use a state "
            "of the ply with this tool"
        )


def turn_on_tool(ply: Ply, contact: ToolContact, state: State) -> ndarray:
    """Largest angle between the normals of a tool at two corners of an element.

    In radians, shape (n_elements,); 0 for elements that do not touch the tool or reach
    beyond it.

    Parameters
    ----------
    ply
        The ply.
    contact
        One of its `contacts`.
    state
        State of the ply.
    """
    u, t, corners = state.u, state.load_factor, ply.mesh.t
    x = ply.positions(u)
    within = np.isfinite(contact.gaps_at(x, t))[corners].all(axis=0)
    counted = touching(ply, contact, state) & within
    turn = np.zeros(ply.mesh.nelements)
    normals = contact.normals_at(x, t)
    turn[counted] = largest_turn(normals[:, corners[:, counted]])
    return turn
