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
from skfem import CellBasis, ElementQuad1

from .pattern import padded

# Least number of elements of a patch: three by three determine a quadratic polynomial.
_LEAST = 9

# Maximum number of rings of elements around a node; a mesh of fewer elements than
# `_LEAST` has no larger patch.
_MOST_RINGS = 5

# Weight exp(−4 r²), with r relative to the root mean square distance of the patch: the
# four elements at a node of a regular mesh count more than ten times as much as others.
_DECAY = 4.0

# Regularisation of the coefficients other than the constant one, relative to the trace
# of the normal equations: few elements do not determine a quadratic polynomial.
_LEAST_SHARE = 1e-12


def recovery(mesh: Any) -> csr_matrix:
    """Matrix from values at the centres of elements to smooth values at vertices.

    Parameters
    ----------
    mesh
        Mesh of triangles or quadrilaterals in the plane.

    Returns
    -------
    scipy.sparse.csr_matrix
        Shape (n_vertices, n_elements).  A quadratic polynomial is recovered exactly.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> mesh = MeshQuad().refined(2)
    >>> x, _ = mesh.p[:, mesh.t].mean(axis=1)
    >>> bool(np.allclose(recovery(mesh) @ x**2, mesh.p[0] ** 2))
    True
    """
    touch = _touching(mesh)
    nodes, smooth = np.arange(mesh.nvertices), csr_matrix(touch.shape)
    patch, grown = touch, touch.T @ touch
    for rings in range(2, _MOST_RINGS + 1):
        patch = (patch @ grown).tocsr()
        large = np.diff(patch.indptr) >= _LEAST
        large |= rings == _MOST_RINGS
        if large.any():
            smooth = smooth + _fitted(mesh, nodes[large], patch[large])
        nodes, patch = nodes[~large], patch[~large]
    return smooth


def _fitted(mesh: Any, nodes: ndarray, patch: csr_matrix) -> csr_matrix:
    """Matrix from values at centres to polynomials through the patches of nodes."""
    pairs, n = patch.tocoo(), len(nodes)
    row, element = pairs.row, pairs.col
    away = mesh.p[:, mesh.t].mean(axis=1)[:, element] - mesh.p[:, nodes[row]]
    weighted, A, _ = _normal_equations(row, away, n, _DECAY)
    constant = np.linalg.inv(A)[:, 0]
    shares = np.einsum("pk,kp->p", constant[row], weighted)
    shape = mesh.nvertices, mesh.nelements
    return csr_matrix((shares, (nodes[row], element)), shape)


def contact_points(mesh: Any, mirrors: Sequence[ndarray] = ()) -> csr_matrix:
    """Matrix from the nodes of quadrilaterals to the contact points of these nodes.

    Elements are chords of a curved ply.  On a surface of the normal curvatures κ along
    edges of the lengths h, the mean depth of elements below their nodes is ``Σ κ
    h²/12``.  The contact point of a node is below it by this depth, so that elements
    whose contact points touch a surface lie on it on average.  Second derivatives of
    the position follow from a quadratic polynomial through the nodes of the elements
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
    edges = np.setdiff1d(mesh.boundary_facets(), np.hstack([[], *mirrors]))
    inside = np.setdiff1d(np.arange(n), mesh.facets[:, edges])
    offset = csr_matrix((n, n))
    if inside.size:
        at_nearest = _nearest(mesh, around, inside)
        derivatives = _second_derivatives(mesh, around[inside], inside, mirrors)
        corners = mesh.p[:, mesh.t]
        across = corners[:, 2:3] - corners[:, :1]
        x, y = 0.5 * (across + corners[:, [1, 3]] - corners[:, [3, 1]])
        squares = np.array([x * x, 2 * x * y, y * y]).sum(axis=1) / 12
        means = (touch @ squares.T) / np.asarray(touch.sum(axis=1))
        for square, derivative in zip(means.T, derivatives, strict=True):
            offset += at_nearest.multiply(square[:, None]) @ derivative
    return csr_matrix(identity(n) + offset)


def _second_derivatives(
    mesh: Any, patch: csr_matrix, inside: ndarray, mirrors: Sequence[ndarray]
) -> list[csr_matrix]:
    """Derivatives ∂²/∂x², ∂²/∂x∂y and ∂²/∂y² at n nodes, each (n, n_vertices).

    ``patch`` has the nodes around each of them.
    """
    pairs = patch.tocoo()
    row, node = pairs.row, pairs.col
    away = mesh.p[:, node] - mesh.p[:, inside[row]]
    for plane in mirrors:  # images of the nodes around those on the plane
        on, N = nodes_and_normal(mesh, plane)
        image = np.isin(inside[row], on) & ~np.isin(node, on)
        reflected = away[:, image] - 2 * np.outer(N, N @ away[:, image])
        row, node = np.append(row, row[image]), np.append(node, node[image])
        away = np.hstack([away, reflected])
    weighted, A, size = _normal_equations(row, away, inside.size)
    squares = np.linalg.inv(A)[:, 3:] / size[:, None, None] ** 2
    fits = np.einsum("pkm,mp->kp", squares[row], weighted) * [[2.0], [1.0], [2.0]]
    return [csr_matrix((fit, (row, node)), patch.shape) for fit in fits]


def _nearest(mesh: Any, around: csr_matrix, inside: ndarray) -> csr_matrix:
    """Matrix from values at nodes inside to those nodes, and to others beside them.

    Shape (n_vertices, n_inside); the rows of nodes that have no neighbour inside are
    zero.
    """
    number = np.full(mesh.nvertices, -1)
    number[inside] = np.arange(inside.size)
    pairs = around.tocoo()
    beside = (number[pairs.row] < 0) & (number[pairs.col] >= 0)
    node, other = pairs.row[beside], pairs.col[beside]
    far = np.linalg.norm(mesh.p[:, node] - mesh.p[:, other], axis=0)
    order = np.lexsort((far, node))
    which, first = np.unique(node[order], return_index=True)
    number[which] = number[other[order][first]]
    has = np.flatnonzero(number >= 0)
    shape = mesh.nvertices, inside.size
    return csr_matrix((np.ones(has.size), (has, number[has])), shape)


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


class ContactPoints:
    """Contact points of the nodes of a ply, see `contact_points`.

    Parameters
    ----------
    X
        Nodes of the undeformed ply in mm, shape (3, n_nodes).
    basis
        Basis of the displacement.
    recovered
        False for the nodes themselves.

    Attributes
    ----------
    matrix
        Weights of the nodes at each contact point, shape (n_nodes, n_nodes).
    nodes
        Numbers of the nodes on which each contact point depends, shape (n, n_nodes).
    """

    def __init__(self, X: ndarray, basis: CellBasis, recovered: bool = True) -> None:
        self._X, self.matrix = X, csr_matrix(identity(X.shape[1]))
        mirrors = getattr(basis, "mirrors", ())
        bilinear: Any = basis.elem
        if recovered and isinstance(bilinear.elem, ElementQuad1):
            self.matrix = contact_points(basis.mesh, mirrors)
        self._mirrors = [nodes_and_normal(basis.mesh, edges) for edges in mirrors]
        self.nodes, self._weights = padded(self.matrix)
        self._to_nodes = csr_matrix(self.matrix.T)

    def positions(self, u: ndarray) -> ndarray:
        """Positions at a displacement in mm, shape (3, n_nodes)."""
        return self._X + (self.matrix @ u.reshape(-1, 3)).T

    def in_planes(self, u: ndarray) -> ndarray:
        """Positions, of nodes on a plane of symmetry without their motion off it.

        The normals of a symmetric tool lie in the plane, so that its forces on these
        points are those on the ``positions``.
        """
        x = self.positions(u)
        for nodes, N in self._mirrors:
            off = N @ (x - self._X)[:2, nodes]
            x[:2, nodes] -= np.outer(N, off)
        return x

    def along_planes(self, K: ndarray) -> ndarray:
        """Blocks at the points, (3, 3, n_nodes), for motions ``in_planes``."""
        for nodes, N in self._mirrors:
            along = np.eye(3) - np.outer([*N, 0.0], [*N, 0.0])
            K[:, :, nodes] = np.einsum("ij,jkn,kl->iln", along, K[:, :, nodes], along)
        return K

    def nodal(self, f: ndarray) -> ndarray:
        """DOF vector of forces on the contact points, shape (n_nodes, 3)."""
        return np.ravel(self._to_nodes @ f)

    def matrices(self, K: ndarray) -> ndarray:
        """Arguments of `Pattern.sum` for blocks at the points, (3, 3, n_nodes)."""
        one, other = self._weights[np.array(np.triu_indices(len(self.nodes)))]
        return (one * other)[:, None, None] * K
