"""Stabilisation by the jump of the shear angle across the edges between elements.

It vanishes wherever the shear angle is continuous, for one that is linear in position
too, and reaches over the neighbours of an element.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import (
    BilinearForm,
    DiscreteField,
    ElementQuad1,
    ElementVector,
    Functional,
    InteriorFacetBasis,
    LinearForm,
    Mesh,
)
from skfem.helpers import ddot, grad

from . import kinematics as kin
from .elements import CENTRE
from .fabric import Fabric
from .forms import Forms, contract, directions, once

_MIDDLE = np.array([[0.5]]), np.array([1.0])


class JumpBasis(InteriorFacetBasis):
    """Basis of the displacement at the middles of interior edges, from either side.

    The two points of an edge are one, its middle, seen from the elements on either
    side: a jump is a difference between points.  Together they carry (A⁺ + A⁻)/4, from
    the reference areas of the two elements.

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
        self._element_dofs = np.vstack([self.element_dofs, other.element_dofs])
        self.basis = [
            (_at_point(i, field),)
            for i, side in enumerate((self, other))
            for (field,) in side.basis
        ]
        self.Nbfun = len(self.basis)
        self._sides = np.array([self.tind, other.tind]).T
        self.X = np.repeat(self.X, 2, axis=1)
        centre, _ = CENTRE
        areas = [np.abs(self.mapping.detDF(centre, s.tind)) for s in (self, other)]
        self.dx = np.repeat(sum(areas) / 8, 2, axis=1)

    def default_parameters(self) -> dict[str, Any]:
        """Position, and the element on that side."""
        return {"x": self.global_coordinates(), "element": self._sides}


def shear_continuity(fabric: Fabric, C_j: float) -> Forms:
    """Stabilisation with the energy ½ C_j Σ_edges (A⁺ + A⁻)/4 [[Γ]]².

    The forms go with `JumpBasis`.

    Parameters
    ----------
    fabric
        Gives the fibre directions; its stiffnesses play no part.
    C_j
        Stabilisation stiffness in N/mm.
    """

    def jump(w):
        return _jump(kin.shear_angle(_F(w), *directions(fabric, w)))

    def variation(w):
        return kin.shear_angle_d(_F(w), *directions(fabric, w))

    def curvature(w):
        return kin.shear_angle_dd(_F(w), *directions(fabric, w))

    @Functional
    def energy(w):
        return 0.5 * C_j * jump(w) ** 2

    @LinearForm
    def residual(v, w):
        return C_j * once(w, jump) * _jump(ddot(once(w, variation), grad(v)))

    @BilinearForm
    def tangent(u, v, w):
        d = once(w, variation)
        second = contract(grad(v), once(w, curvature), grad(u))
        return C_j * (
            _jump(ddot(d, grad(u))) * _jump(ddot(d, grad(v)))
            + once(w, jump) * _jump(second)
        )

    return Forms(energy, residual, tangent)


def _jump(x: ndarray) -> ndarray:
    """[[x]], the same at both points of an edge."""
    return np.repeat(x[..., :1] - x[..., 1:], 2, axis=-1)


def _F(w: Any) -> ndarray:
    return kin.deformation_gradient(grad(w["u"]))


def _at_point(i: int, field: DiscreteField) -> DiscreteField:
    """A field at the i-th of two points, zero at the other."""
    where = np.arange(2) == i
    return DiscreteField(np.asarray(field) * where, np.asarray(field.grad) * where)
