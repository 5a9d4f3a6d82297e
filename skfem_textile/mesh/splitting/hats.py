"""Functions that are linear between the corners of what was split."""

from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix, hstack, identity
from skfem import Mesh, MeshTri

from .edges import edges_of


def hat_functions(mesh: Mesh, n_nodes: int) -> csr_matrix:
    """Values at all nodes of functions that are 1 at one corner and 0 at the others.

    They are linear along the edges of the cells, and in the middle of a cell the mean
    of its corners.

    Parameters
    ----------
    mesh
        Triangles, whose further nodes are the middles of their edges; a `SplitMesh`,
        whose corners are those of its cells; or other quadrilaterals.
    n_nodes
        Number of nodes.

    Returns
    -------
    csr_matrix
        Shape (n_corners, n_nodes).
    """
    parts: Any = mesh
    cells = getattr(parts, "cells", ())
    if isinstance(mesh, MeshTri):
        groups = [mesh.facets] if n_nodes > mesh.p.shape[1] else []
    else:
        groups = [edges_of(cells)[0], *cells] if cells else []
    n = n_nodes - sum(group.shape[1] for group in groups)
    blocks = [identity(n), *(_means(group, n) for group in groups)]
    return csr_matrix(hstack(blocks))


def _means(corners: ndarray, n: int) -> csr_matrix:
    """The mean of some of ``n`` values, given by their numbers, shape (k, m)."""
    k, m = corners.shape
    columns = np.tile(np.arange(m), k)
    return csr_matrix((np.full(k * m, 1 / k), (corners.ravel(), columns)), (n, m))
