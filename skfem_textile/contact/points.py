"""Contact points of the nodes of a ply, on which forces of tools act."""

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix, identity
from skfem import CellBasis, ElementQuad1

from ..mesh.recovery import contact_points, nodes_and_normal


class ContactPoints:
    """Contact points of the nodes of a ply, see `contact_points`.

    Parameters
    ----------
    X
        Nodes of the undeformed ply in mm, shape (3, n_nodes).
    basis
        Basis of the displacement.

    Attributes
    ----------
    matrix
        Weights of the nodes at each contact point, shape (n_nodes, n_nodes).
    nodes
        Numbers of the nodes on which each contact point depends, shape (n, n_nodes).
    """

    def __init__(self, X: ndarray, basis: CellBasis) -> None:
        self._X, self.matrix = X, csr_matrix(identity(X.shape[1]))
        mirrors = getattr(basis, "mirrors", ())
        if isinstance(basis.elem.elem, ElementQuad1):  # type: ignore[attr-defined]
            self.matrix = contact_points(basis.mesh, mirrors)
        self._mirrors = [nodes_and_normal(basis.mesh, edges) for edges in mirrors]
        self.nodes, self._weights = _padded(self.matrix)
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


def _padded(points: csr_matrix) -> tuple[ndarray, ndarray]:
    """Nodes in the rows of a matrix and their weights, each (n, n_rows).

    Shorter rows are padded with their first node and zero weights.
    """
    size = np.diff(points.indptr)
    within = np.arange(size.max())[:, None]
    at = points.indptr[:-1] + np.where(within < size, within, 0)
    return points.indices[at], np.where(within < size, points.data[at], 0.0)
