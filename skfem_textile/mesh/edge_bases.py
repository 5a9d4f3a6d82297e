"""Bases of the displacement at interior edges, and at nodes of elements."""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import (
    CellBasis,
    DiscreteField,
    ElementQuad1,
    ElementVector,
    InteriorFacetBasis,
    Mesh,
)

from .bases import CENTRE, refuse_mesh
from .scikit_fem import set_element_dofs


class CornerBasis(CellBasis):
    """Basis of the displacement at one node of each of the given elements.

    Each of the n nodes of an element has the weight A/n, where A is the area of the
    element.

    Parameters
    ----------
    basis
        Basis of the displacement.
    elements, corners
        Numbers of the elements, which may repeat, and the local number of the node.
    """

    def __init__(self, basis: CellBasis, elements: ndarray, corners: ndarray) -> None:
        element: Any = basis.elem
        points = element.elem.doflocs.T
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


_MIDDLE = np.array([[0.5]]), np.array([1.0])


class JumpBasis(InteriorFacetBasis):
    """Basis of the displacement at the midpoints of interior edges, on both sides.

    Each edge has two points at its midpoint, one in the element on either side; a jump
    is the difference between them.  Their weights add up to (A⁺ + A⁻)/4, with the
    reference areas of the two elements.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad`.
    **kwargs
        Passed to `skfem.InteriorFacetBasis`: ``mapping``, ``dofs``.
    """

    def __init__(self, mesh: Mesh, **kwargs: Any) -> None:
        refuse_mesh("JumpBasis", mesh)
        element = ElementVector(ElementQuad1())
        super().__init__(mesh, element, quadrature=_MIDDLE, **kwargs)
        other = InteriorFacetBasis(mesh, element, quadrature=_MIDDLE, side=1, **kwargs)
        set_element_dofs(self, np.vstack([self.element_dofs, other.element_dofs]))
        first, second = np.eye(2)  # 1 at the point of this side, 0 at the other
        self.basis = [
            (DiscreteField(np.asarray(field) * sign, np.asarray(field.grad) * sign),)
            for sign, side in ((first, self), (second, other))
            for (field,) in side.basis
        ]
        self._sides = np.array([self.tind, other.tind]).T
        self.X = np.repeat(self.X, 2, axis=1)
        centre, _ = CENTRE
        areas = [np.abs(self.mapping.detDF(centre, s.tind)) for s in (self, other)]
        # (A⁺ + A⁻)/4, half of it for each of the two points
        self.dx = np.repeat(sum(areas) / 8, 2, axis=1)

    def default_parameters(self) -> dict[str, Any]:
        """Position, and the element of each point."""
        return {"x": self.global_coordinates(), "element": self._sides}
