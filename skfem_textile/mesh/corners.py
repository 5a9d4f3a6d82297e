"""Corners of elements, which fold first."""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from .bases import components, node_positions

# A corner is flat if det J is below this share of the largest of its element.  Chosen:
# far above rounding, as in `checks`.
_FLAT = 1e-9


class CornerBasis(CellBasis):
    """Basis of the displacement at one node of each of the given elements.

    Each of the n nodes of an element has the weight A/n, where A is its area.

    Parameters
    ----------
    basis
        Basis of the displacement.
    elements, corners
        Numbers of the elements, which may repeat, and the local number of the node.
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
    """Area ratio det F at the nodes of the elements of a basis.

    det F = det(∂x/∂ξ) / det(∂X/∂ξ): at a corner the columns of ∂x/∂ξ are edges of the
    element, so that it takes half the time of F.  In space the cross product of the
    columns takes the place of the determinant: its length, negative at a node where it
    opposes its mean over the element (`sided`).  The last result is kept, because
    an iteration needs it several times.

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
        self._edges, edge_of = np.unique(tangents, axis=0, return_inverse=True)
        self._pairs = edge_of.reshape(-1, 2)
        self._d = d = components(basis)
        self._nodes = basis.element_dofs[::d] // d
        self._X = np.ascontiguousarray(node_positions(basis).T)
        reference = self._of_plane(self._X)
        self._turn = np.sign(reference.sum(axis=0))
        positive = reference * self._turn
        self._reflex = positive <= _FLAT * positive.max(axis=0)
        self._per_area = 1 / np.where(self._reflex, np.inf, reference)
        self._last = np.empty(0), np.empty(0)

    def area_ratio(self, u: ndarray) -> ndarray:
        """Current area per reference area, det F, shape (n_points, n_elements).

        Infinite at a corner that is flat or reflex in the reference configuration,
        where det F has no meaning.
        """
        last, ratio = self._last
        if np.array_equal(last, u):
            return ratio
        moved = u.reshape(-1, self._d)
        if self._d == 2:
            ratio = self._of_plane(self._X + moved) * self._per_area
        else:
            ratio = self._in_space(moved) * np.abs(self._per_area)
        ratio[self._reflex] = np.inf
        self._last = u.copy(), ratio
        return ratio

    def normals(self, u: ndarray) -> ndarray:
        """Normals of the elements in space, of any length, shape (3, n_elements).

        At rest all lie on the same side of the ply.
        """
        return self._turn * self._vectors(u.reshape(-1, 3)).sum(axis=1)

    def _of_plane(self, x: ndarray) -> ndarray:
        """det(∂x/∂ξ) of positions (n_nodes, 2), shape (n_points, n_elements)."""
        edges = self._edges @ x.view(complex)[self._nodes, 0]
        det = np.empty((len(self._pairs), edges.shape[1]))
        for i, (xi, eta) in enumerate(self._pairs):
            det[i] = edges[xi].real * edges[eta].imag
            det[i] -= edges[xi].imag * edges[eta].real
        return det

    def _in_space(self, moved: ndarray) -> ndarray:
        """The length of the cross products, with its sign, (n_points, n_elements)."""
        vectors = self._vectors(moved)
        return sided(vectors, vectors.sum(axis=1, keepdims=True))

    def _vectors(self, moved: ndarray) -> ndarray:
        """∂x/∂ξ × ∂x/∂η of displacements (n_nodes, 3), (3, n_points, n_elements)."""
        x = np.pad(self._X, ((0, 0), (0, 1))) + moved
        edges = [self._edges @ component[self._nodes] for component in x.T]
        first, second = np.array(edges)[:, self._pairs].transpose(2, 0, 1, 3)
        return np.cross(first, second, axis=0)


def sided(vectors: ndarray, normals: ndarray) -> ndarray:
    """Lengths of area vectors, negative where they oppose the normal of their element.

    An area in space has no sign, and a ply may lie upside down.  A part of an element
    that faces the other way than the element does is folded.

    Parameters
    ----------
    vectors, normals
        Arrays of vectors that broadcast, shape (3, ...).
    """
    side = (vectors * normals).sum(axis=0)
    return np.copysign(np.linalg.norm(vectors, axis=0), side)


def _local_nodes(basis: CellBasis) -> ndarray:
    """Reference coordinates of the nodes of the element, shape (2, n)."""
    element: Any = basis.elem
    return element.elem.doflocs.T
