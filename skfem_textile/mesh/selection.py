"""Selection of nodes by name, number or position."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import CellBasis, Mesh

from .bases import node_positions
from .named_nodes import named_nodes
from .user_input import call_user_function

Where: TypeAlias = str | ArrayLike | Callable[[ndarray], ndarray]


def selected_nodes(what: str, where: Where, basis: CellBasis) -> ndarray:
    """Numbers of selected nodes: in the given order, or ascending if there is none.

    Parameters
    ----------
    what
        What acts on the nodes, for messages.
    where
        The name of a boundary or of nodes of the mesh, a function of position
        ``(2, n) -> (n,) bool``, one bool per node, or node numbers.
    basis
        Basis of the displacement: its nodes are the vertices, then the middles of edges
        if the element has nodes there.

    Raises
    ------
    ValueError
        If the name is unknown, the nodes are not valid, or there are none.
    """
    mesh, X = basis.mesh, node_positions(basis)
    n_vertices, n_nodes = mesh.p.shape[1], X.shape[1]
    if isinstance(where, str):
        nodes = _named(what, where, mesh, n_nodes > n_vertices)
    else:
        chosen = _as_array(what, where, X)
        if chosen.dtype == bool and chosen.shape == (n_nodes,):
            nodes = np.flatnonzero(chosen)
        elif chosen.dtype.kind in "iu" and not callable(where):
            nodes = chosen.ravel()
        else:
            raise ValueError(
                f"{what}: where must be a boundary's name, node numbers, a function of "
                f"position, or true or false for each of the {n_nodes} of ply.nodes"
            )
    if nodes.size == 0:
        raise ValueError(f"{what} acts on no node")
    if nodes.min() < 0 or nodes.max() >= n_nodes:
        raise ValueError(f"{what}: there are nodes 0 to {n_nodes - 1} only")
    return nodes


def _as_array(what: str, where: Any, X: ndarray) -> ndarray:
    """A selection as an array; without bools or whole numbers if it is invalid."""
    if callable(where):
        where = call_user_function(f"{what}: where", where, X)
    try:
        return np.asarray(where)
    except ValueError:  # lists of different lengths
        return np.empty(0)


def _named(what: str, where: str, mesh: Mesh, with_middles: bool) -> ndarray:
    """Nodes of the boundary and of the named nodes of this name, ascending."""
    edges, nodes = mesh.boundaries or {}, named_nodes(mesh)
    if where not in edges and where not in nodes:
        names = ", ".join(map(repr, [*edges, *(n for n in nodes if n not in edges)]))
        raise ValueError(
            f"{what}: the mesh has no boundary {where!r} (it has: {names or 'none'})"
        )
    edge = np.asarray(edges.get(where, ()), dtype=int)
    selected = np.union1d(mesh.facets[:, edge], nodes.get(where, ())).astype(int)
    if with_middles:
        selected = np.concatenate([selected, mesh.p.shape[1] + np.unique(edge)])
    return selected
