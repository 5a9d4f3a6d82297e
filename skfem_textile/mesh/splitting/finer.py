"""A mesh of which every element is split in four."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri

from ..named_nodes import named_nodes, with_named_nodes
from .edges import edges_of
from .quadrilaterals import split
from .refined_triangles import refine_triangles


@dataclass(frozen=True, eq=False)
class FinerMesh:
    """A mesh of which every element is split in four, with the names of the one before.

    Attributes
    ----------
    mesh
        The finer mesh.  Its first nodes are those of the mesh before, then of triangles
        the middles of the edges in the order of ``facets``.
    parent
        For each element the one before that it is part of, shape (n_elements,).
    """

    mesh: Mesh
    parent: ndarray

    def nodal(self, values: ndarray, n_nodes: int) -> ndarray:
        """Values at the nodes of a finer mesh, shape (..., n_nodes).

        They are those at the nodes before, shape (..., n_before), and between them
        linear along edges, and their mean in the middle of elements.
        """
        if isinstance(self.mesh, MeshTri):
            return np.hstack([values, values[:, self.mesh.facets].mean(axis=1)])
        parts: Any = self.mesh
        cells = parts.cells
        pairs, _ = edges_of(cells)
        centres = [values[:, cell].mean(axis=1) for cell in cells]
        return np.hstack([values, values[:, pairs].mean(axis=1), *centres])[:, :n_nodes]


def finer_mesh(mesh: Mesh) -> FinerMesh:
    """Split every element of a mesh in four, however it came to be.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad` or a `skfem.MeshTri`.
    """
    if isinstance(mesh, MeshTri):
        refined = refine_triangles(mesh, np.arange(mesh.nelements))
        return FinerMesh(refined.mesh, refined.parent)
    plain = MeshQuad(mesh.p, mesh.t, mesh.boundaries, mesh.subdomains)
    parts = split(with_named_nodes(plain, named_nodes(mesh)))
    return FinerMesh(parts, parts.origin[parts.parent])
