"""Basis at the middles of the edges between elements, on both sides."""

from typing import Any

import numpy as np
from skfem import (
    DiscreteField,
    ElementQuad1,
    ElementVector,
    InteriorFacetBasis,
    Mesh,
)

from .bases import CENTRE
from .scikit_fem import set_element_dofs

_MIDDLE = np.array([[0.5]]), np.array([1.0])


class JumpBasis(InteriorFacetBasis):
    """Basis of the displacement at the middles of interior edges, on both sides.

    Each edge has two points, both at its middle, one in the element on either side: a
    jump is the difference between them.  Their weights add up to (A⁺ + A⁻)/4, with the
    reference areas of the two elements.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad`.
    **kwargs
        Passed to `skfem.InteriorFacetBasis`: ``mapping``, ``dofs``.
    """

    def __init__(self, mesh: Mesh, **kwargs: Any) -> None:
        element = ElementVector(ElementQuad1())
        super().__init__(mesh, element, quadrature=_MIDDLE, **kwargs)
        other = InteriorFacetBasis(mesh, element, quadrature=_MIDDLE, side=1, **kwargs)
        set_element_dofs(self, np.vstack([self.element_dofs, other.element_dofs]))
        self.basis = [
            (_at_point(i, field),)
            for i, side in enumerate((self, other))
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


def _at_point(i: int, field: DiscreteField) -> DiscreteField:
    """A field at the i-th of two points, zero at the other."""
    factor = np.arange(2) == i
    return DiscreteField(np.asarray(field) * factor, np.asarray(field.grad) * factor)
