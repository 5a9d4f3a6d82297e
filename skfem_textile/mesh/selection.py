"""Selection of nodes by name, number or position."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, TypeAlias, TypeVar, get_args

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import CellBasis, Mesh, MeshQuad, MeshTri

from .bases import node_positions
from .user_input import call_user_function

#: Name of the interior edges of a mesh along fibres at which the shear angle may jump.
SINGULAR = "singular fibres"

#: Rotating clamp: function of the load factor that returns the rotation vector in space
#: (axis times angle in radians), or the angle in the plane.
Turning: TypeAlias = Callable[[float], ArrayLike]

#: Names of the boundary conditions of fibre ends.
EndName: TypeAlias = Literal["clamped", "mirror"]

#: Boundary condition of fibre ends: fixed initial direction, plane of symmetry, or
#: rotating clamp.  Other fibre ends are hinged.
FibreEnd: TypeAlias = EndName | Turning

FIBRE_ENDS: tuple[str, ...] = get_args(EndName)

_Mesh = TypeVar("_Mesh", bound=Mesh)


@dataclass(repr=False)
class NamedNodes:
    """Mesh with named nodes.

    Attributes
    ----------
    named_nodes
        Node numbers by name.
    """

    named_nodes: dict[str, ndarray] = field(default_factory=dict)

    def restrict(
        self, elements: Any, return_mapping: bool = False, *args: Any, **kwargs: Any
    ) -> Any:
        """Restrict as `skfem.Mesh.restrict`; names keep their remaining nodes."""
        mesh_class: Any = super()
        mesh, nodes_left = mesh_class.restrict(elements, True, *args, **kwargs)
        mesh.named_nodes = {
            name: np.flatnonzero(np.isin(nodes_left, nodes))
            for name, nodes in self.named_nodes.items()
        }
        return (mesh, nodes_left) if return_mapping else mesh


@dataclass(repr=False)
class NamedQuads(NamedNodes, MeshQuad):
    """Quadrilaterals with named nodes."""


@dataclass(repr=False)
class NamedTriangles(NamedNodes, MeshTri):
    """Triangles with named nodes."""


def with_named_nodes(mesh: _Mesh, nodes: Mapping[str, ndarray]) -> _Mesh:
    """Add named nodes to a mesh."""
    if not nodes:
        return mesh
    if isinstance(mesh, NamedNodes):
        return replace(mesh, named_nodes={**mesh.named_nodes, **nodes})
    kind: Any = NamedTriangles if isinstance(mesh, MeshTri) else NamedQuads
    names = mesh.boundaries, mesh.subdomains
    return kind(mesh.p, mesh.t, *names, named_nodes=dict(nodes))


def named_nodes(mesh: Mesh) -> dict[str, ndarray]:
    """Node numbers by name; empty for a plain scikit-fem mesh."""
    return mesh.named_nodes if isinstance(mesh, NamedNodes) else {}


def edge_numbers(edges: ndarray, ends: ndarray) -> ndarray:
    """Numbers of the edges with given ends, shape (m,); −1 if there is none.

    ``edges`` are the end nodes of each edge, ascending, shape (2, n), and ``ends``
    pairs of nodes in any order, shape (2, m).
    """
    n = 1 + max(edges.max(initial=0), ends.max(initial=0))
    keys, (a, b) = edges[0].astype(np.int64) * n + edges[1], np.sort(ends, axis=0)
    order = np.argsort(keys)
    key = a.astype(np.int64) * n + b
    position = np.searchsorted(keys[order], key).clip(max=len(keys) - 1)
    edge = order[position]
    return np.where(keys[edge] == key, edge, -1)


Where: TypeAlias = str | ArrayLike | Callable[[ndarray], ndarray]


def turned_where(where: Where, Q: ndarray) -> Where:
    """The same selection after a rotation Q of the plane."""
    return partial(_turned, where=where, Q=Q) if callable(where) else where


def _turned(X: ndarray, where: Callable, Q: ndarray) -> ndarray:
    return where(Q.T @ X)


def selected_nodes(what: str, where: Where, basis: CellBasis) -> ndarray:
    """Numbers of selected nodes: in the given order, or ascending if there is none.

    Parameters
    ----------
    what
        Description of the condition or load, for messages.
    where
        The name of a boundary or of nodes of the mesh, a function of position
        ``(2, n) -> (n,) bool``, one bool per node, or node numbers.
    basis
        Basis of the displacement: its nodes are the vertices, then the edge midpoints
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
                f"{what}: where must be the name of a boundary, node numbers, a "
                f"function of position, or one bool for each of the {n_nodes} nodes "
                "of ply.nodes"
            )
    if nodes.size == 0:
        raise ValueError(f"{what}: where selects no nodes")
    if nodes.min() < 0 or nodes.max() >= n_nodes:
        raise ValueError(
            f"{what}: node numbers must be from 0 to {n_nodes - 1}, but range from "
            f"{nodes.min()} to {nodes.max()}"
        )
    return nodes


def _as_array(what: str, where: Any, X: ndarray) -> ndarray:
    """Selection as an array; an empty float array if list lengths differ."""
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
            f"{what}: the mesh has no boundary {where!r} (available: {names or 'none'})"
        )
    edge = np.asarray(edges.get(where, ()), dtype=int)
    selected = np.union1d(mesh.facets[:, edge], nodes.get(where, ())).astype(int)
    if with_middles:
        selected = np.concatenate([selected, mesh.p.shape[1] + np.unique(edge)])
    return selected
