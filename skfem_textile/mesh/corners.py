"""The corners of elements, where an element folds first."""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from .bases import node_positions

# A corner is flat where det J is less than this share of the largest in its element.
_FLAT = 1e-9


class CornerBasis(CellBasis):
    """Basis of the displacement at some nodes of elements, one to each of its rows.

    Each of the n nodes of an element has the weight A/n, where A is its area.

    Parameters
    ----------
    basis
        Basis of the displacement.
    elements, corners
        Numbers of the elements, which may repeat, and which of their nodes.
    """

    def __init__(self, basis: CellBasis, elements: ndarray, corners: ndarray) -> None:
        points = _local_nodes(basis)
        super().__init__(
            basis.mesh,
            basis.elem,
            mapping=basis.mapping,
            dofs=basis.dofs,
            elements=elements,
            quadrature=(points[:, corners, None], np.ones(1)),
            disable_doflocs=True,
        )
        area = basis.dx[elements].sum(axis=1, keepdims=True)
        self.dx = area / points.shape[1]


class Corners:
    """The nodes of the elements of a basis, at which det F tells whether they fold.

    det F = det(∂x/∂ξ) / det(∂X/∂ξ): at a corner the columns of ∂x/∂ξ are edges of the
    element.  That takes half the time of F itself, and the last answer is kept, because
    every iteration and every state asks.

    Parameters
    ----------
    basis
        Basis of the displacement.
    """

    def __init__(self, basis: CellBasis) -> None:
        scalar: Any = basis.elem
        scalar, points = scalar.elem, _local_nodes(basis)
        dN = [scalar.lbasis(points, i)[1] for i in range(len(scalar.doflocs))]
        tangents = np.array(dN).transpose(2, 1, 0).reshape(-1, len(dN))
        self._edges, which = np.unique(tangents, axis=0, return_inverse=True)
        self._pairs = which.reshape(-1, 2)
        self._nodes = basis.element_dofs[::2] // 2
        self._X = node_positions(basis).T.ravel()
        reference = self._jacobian(basis.zeros())
        own = reference * np.sign(reference.sum(axis=0))
        self._reflex = own <= _FLAT * own.max(axis=0)
        self._per_area = 1 / np.where(self._reflex, np.inf, reference)
        self._kept = np.empty(0), np.empty(0)

    def area_ratio(self, u: ndarray) -> ndarray:
        """Current area per reference area, det F, shape (n_points, n_elements).

        Infinite at a corner that is flat or reflex in the reference configuration,
        where det F tells nothing.
        """
        last, ratio = self._kept
        if np.array_equal(last, u):
            return ratio
        ratio = self._jacobian(u) * self._per_area
        ratio[self._reflex] = np.inf
        self._kept = u.copy(), ratio
        return ratio

    def _jacobian(self, u: ndarray) -> ndarray:
        """det(∂x/∂ξ), shape (n_points, n_elements)."""
        edges = self._edges @ (self._X + u).view(complex)[self._nodes]
        det = np.empty((len(self._pairs), edges.shape[1]))
        for i, (xi, eta) in enumerate(self._pairs):
            det[i] = edges[xi].real * edges[eta].imag
            det[i] -= edges[xi].imag * edges[eta].real
        return det


def _local_nodes(basis: CellBasis) -> ndarray:
    """Reference coordinates of the nodes of the element, shape (2, n)."""
    element: Any = basis.elem
    return element.elem.doflocs.T
