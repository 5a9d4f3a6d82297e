"""Nodes with names, and edges by the nodes at their ends."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri

_Mesh = TypeVar("_Mesh", bound=Mesh)


@dataclass(repr=False)
class NamedNodes:
    """A mesh with named nodes.

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
    """Add names of nodes to a mesh."""
    if not nodes:
        return mesh
    if isinstance(mesh, NamedNodes):
        return replace(mesh, named_nodes={**mesh.named_nodes, **nodes})
    kind: Any = NamedTriangles if isinstance(mesh, MeshTri) else NamedQuads
    names = mesh.boundaries, mesh.subdomains
    return kind(mesh.p, mesh.t, *names, named_nodes=dict(nodes))


def named_nodes(mesh: Mesh) -> dict[str, ndarray]:
    """Node numbers by name; empty for a plain mesh of scikit-fem."""
    return mesh.named_nodes if isinstance(mesh, NamedNodes) else {}


def edge_numbers(edges: ndarray, ends: ndarray) -> ndarray:
    """Number of the edge with given ends, shape (m,); −1 if there is none.

    Parameters
    ----------
    edges
        End nodes of each edge, ascending, shape (2, n).
    ends
        Pairs of nodes in any order, shape (2, m).
    """
    n = 1 + max(edges.max(initial=0), ends.max(initial=0))
    keys, (a, b) = edges[0].astype(np.int64) * n + edges[1], np.sort(ends, axis=0)
    order = np.argsort(keys)
    wanted = a.astype(np.int64) * n + b
    position = np.searchsorted(keys[order], wanted).clip(max=len(keys) - 1)
    edge = order[position]
    return np.where(keys[edge] == wanted, edge, -1)
