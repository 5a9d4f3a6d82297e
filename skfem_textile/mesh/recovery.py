"""Recovery of a smooth field at the nodes from one value per element.

At each node a quadratic polynomial is fitted by weighted least squares to the values at
the centres of the elements around it (Zienkiewicz & Zhu 1992).
"""

from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

#: Least number of elements of a patch: three by three determine a quadratic polynomial.
LEAST = 9

# Maximum number of rings of elements around a node; a mesh of fewer elements than
# `LEAST` has no larger patch.
_MOST_RINGS = 5

# Weight exp(−4 r²), with r relative to the root mean square distance of the patch: the
# four elements at a node of a regular mesh count more than ten times as much as others.
_DECAY = 4.0

# Regularisation of the coefficients other than the constant one, relative to the trace
# of the normal equations: few elements do not determine a quadratic polynomial.
_LEAST_SHARE = 1e-12


def recovered(mesh: Any, values: ndarray, least: int = LEAST) -> ndarray:
    """Smooth values at the vertices of a mesh.

    Parameters
    ----------
    mesh
        Mesh of triangles or quadrilaterals in the plane.
    values
        Values at the centres of the elements, shape (n_elements,).
    least
        Least number of elements of a patch.

    Returns
    -------
    ndarray
        Shape (n_vertices,).  A quadratic polynomial is recovered exactly.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> mesh = MeshQuad().refined(2)
    >>> centres = mesh.p[:, mesh.t].mean(axis=1)
    >>> bool(np.allclose(recovered(mesh, centres[0] ** 2), mesh.p[0] ** 2))
    True
    """
    n, corners = mesh.nvertices, mesh.t.ravel()
    elements = np.tile(np.arange(mesh.nelements), len(mesh.t))
    touch = csr_matrix(
        (np.ones(corners.size), (corners, elements)), (n, mesh.nelements)
    )
    nodes, smooth = np.arange(n), np.empty(n)
    patch, grown = touch, touch.T @ touch
    for rings in range(2, _MOST_RINGS + 1):
        patch = (patch @ grown).tocsr()
        large = np.diff(patch.indptr) >= least
        large |= rings == _MOST_RINGS
        if large.any():
            smooth[nodes[large]] = _fitted(mesh, values, nodes[large], patch[large])
        nodes, patch = nodes[~large], patch[~large]
    return smooth


def _fitted(mesh: Any, values: ndarray, nodes: ndarray, patch: csr_matrix) -> ndarray:
    """Values at nodes of polynomials through the elements of their patches."""
    pairs, n = patch.tocoo(), len(nodes)
    row, element = pairs.row, pairs.col
    away = mesh.p[:, mesh.t].mean(axis=1)[:, element] - mesh.p[:, nodes[row]]
    square = (away**2).sum(axis=0)
    size = np.sqrt(np.bincount(row, square, n) / np.bincount(row, minlength=n))
    x, y = away / size[row]
    terms = np.array([np.ones_like(x), x, y, x * x, x * y, y * y])
    weighted = np.exp(-_DECAY * (x * x + y * y)) * terms
    A = np.array([[np.bincount(row, a * b, n) for b in terms] for a in weighted])
    b = np.array([np.bincount(row, a * values[element], n) for a in weighted])
    A[np.arange(1, 6), np.arange(1, 6)] += _LEAST_SHARE * np.trace(A)
    solved = np.linalg.solve(A.transpose(2, 0, 1), b.T[..., None])
    return np.asarray(solved[:, 0, 0])
