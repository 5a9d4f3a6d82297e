"""Recovery at the nodes by quadratic polynomials fitted by least squares.

A smooth field is recovered from one value per element: the polynomial at a node is
fitted to the values at the centres of the elements around it (Zienkiewicz & Zhu 1992).
Contact points of a ply are recovered from the nodes of these elements.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix, identity

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
    n, touch = mesh.nvertices, _touching(mesh)
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
    weighted, A, _ = _normal_equations(row, away, n, _DECAY)
    b = np.array([np.bincount(row, a * values[element], n) for a in weighted])
    solved = np.linalg.solve(A, b.T[..., None])
    return np.asarray(solved[:, 0, 0])


def contact_points(mesh: Any, mirrors: Sequence[ndarray] = ()) -> csr_matrix:
    """Matrix from the nodes of quadrilaterals to the contact points of these nodes.

    Elements are chords of a curved ply.  On a surface of the normal curvatures κ along
    edges of the lengths h, the mean depth of elements below their nodes is ``Σ κ
    h²/12``.  The contact point of a node is below it by this depth, so that elements
    whose contact points touch a surface lie on it in the mean.  Second derivatives of
    the position are those of a quadratic polynomial through the nodes of the elements
    around a node; at a boundary, around the nearest node inside.

    Parameters
    ----------
    mesh
        Mesh of quadrilaterals in the plane.
    mirrors
        Numbers of the edges on each plane of symmetry.

    Returns
    -------
    scipy.sparse.csr_matrix
        Shape (n_vertices, n_vertices).  Linear functions of position do not change.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> mesh = MeshQuad().refined(2).scaled(40.0)
    >>> X = mesh.p[:, [12]]  # the centre; elements of 10 mm
    >>> bool(np.isclose((contact_points(mesh) @ mesh.p[0] ** 2)[12], X[0]**2 + 100 / 6))
    True
    """
    n, touch = mesh.nvertices, _touching(mesh)
    around = (touch @ touch.T).tocsr()
    ends = mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), np.hstack([[], *mirrors]))]
    inside = np.setdiff1d(np.arange(n), ends)
    if not inside.size:
        return csr_matrix(identity(n))
    patch = around[inside].tocoo()
    row, node = patch.row, patch.col
    away = mesh.p[:, node] - mesh.p[:, inside[row]]
    for plane in mirrors:  # images of the nodes around those on the plane
        on, N = nodes_and_normal(mesh, plane)
        image = np.isin(inside[row], on) & ~np.isin(node, on)
        reflected = away[:, image] - 2 * np.outer(N, N @ away[:, image])
        row, node = np.append(row, row[image]), np.append(node, node[image])
        away = np.hstack([away, reflected])
    weighted, A, size = _normal_equations(row, away, inside.size)
    second = np.linalg.inv(A)[:, 3:] / size[:, None, None] ** 2  # of x², x y and y²
    fits = np.einsum("pkm,mp->kp", second[row], weighted)

    nearest = np.full(n, -1)
    nearest[inside] = np.arange(inside.size)
    pairs = around.tocoo()
    outer = (nearest[pairs.row] < 0) & (nearest[pairs.col] >= 0)
    outside, close = pairs.row[outer], nearest[pairs.col[outer]]
    far = np.linalg.norm(mesh.p[:, outside] - mesh.p[:, inside[close]], axis=0)
    order = np.lexsort((far, outside))
    which, first = np.unique(outside[order], return_index=True)
    nearest[which] = close[order][first]
    has = np.flatnonzero(nearest >= 0)
    to_inside = csr_matrix(
        (np.ones(has.size), (has, nearest[has])), (n, inside.size)
    )

    corners = mesh.p[:, mesh.t]
    x, y = 0.5 * (corners[:, [1, 3]] - corners[:, :1] + corners[:, 2:3] - corners[:, [3, 1]])
    squares = np.array([x * x, x * y, y * y]).sum(axis=1) / 6
    means = (touch @ squares.T) / np.asarray(touch.sum(axis=1))
    offset = csr_matrix((n, n))
    for square, fit in zip(means.T, fits, strict=True):
        derivative = csr_matrix((fit, (row, node)), (inside.size, n))
        offset += to_inside.multiply(square[:, None]) @ derivative
    return csr_matrix(identity(n) + offset)


def nodes_and_normal(mesh: Any, edges: ndarray) -> tuple[ndarray, ndarray]:
    """Numbers of the nodes of edges on a straight line, and its unit normal, (2,)."""
    nodes = mesh.facets[:, edges]
    along = mesh.p[:, nodes[1, 0]] - mesh.p[:, nodes[0, 0]]
    return np.unique(nodes), np.array([along[1], -along[0]]) / np.hypot(*along)


def _touching(mesh: Any) -> csr_matrix:
    """1 for each element at a node, shape (n_vertices, n_elements)."""
    corners = mesh.t.ravel()
    elements = np.tile(np.arange(mesh.nelements), len(mesh.t))
    shape = mesh.nvertices, mesh.nelements
    return csr_matrix((np.ones(corners.size), (corners, elements)), shape)


def _normal_equations(
    row: ndarray, away: ndarray, n: int, decay: float = 0.0
) -> tuple[ndarray, ndarray, ndarray]:
    """Normal equations of quadratic polynomials in relative positions from n nodes.

    Weighted terms at the points, (6, n_points), matrices, (n, 6, 6), and lengths that
    are the units of the positions, (n,).
    """
    square = (away**2).sum(axis=0)
    size = np.sqrt(np.bincount(row, square, n) / np.bincount(row, minlength=n))
    x, y = away / size[row]
    terms = np.array([np.ones_like(x), x, y, x * x, x * y, y * y])
    weighted = np.exp(-decay * (x * x + y * y)) * terms
    A = np.array([[np.bincount(row, a * b, n) for b in terms] for a in weighted])
    A[np.arange(1, 6), np.arange(1, 6)] += _LEAST_SHARE * np.trace(A)
    return weighted, A.transpose(2, 0, 1), size
