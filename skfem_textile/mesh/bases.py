"""Finite elements, quadrature rules and nodes.

Quadratic triangles have three points; bilinear quadrilaterals have the centre, 2×2
points or both.  Their gradient is its value at the centre plus a fluctuation,
∇N(ξ) = ∇N(0) + (∇N(ξ) − ∇N(0)).  The fluctuation is exactly the paper's
B_HGL = γ ⊗ ∇h (Hamila & Boisse 2013, §3.1).
"""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import (
    CellBasis,
    DiscreteField,
    ElementQuad1,
    ElementTriP2,
    ElementVector,
    Mesh,
)
from skfem.assembly.basis import AbstractBasis
from skfem.quadrature import get_quadrature

#: One point at the centre, carrying the exact area of a bilinear quadrilateral.
CENTRE = (np.array([[0.5], [0.5]]), np.array([1.0]))

#: 2×2 Gauss points.
GAUSS = get_quadrature(ElementQuad1, 3)

#: Three points of a triangle, exact to degree 2.
THREE = get_quadrature(ElementTriP2, 2)

#: Six points of a triangle, exact to degree 4.
SIX = get_quadrature(ElementTriP2, 4)


class ElementQuad1Fluctuation(ElementQuad1):
    """Bilinear element whose gradient is the fluctuation ∇N(ξ) − ∇N(0).

    `centre_grad` returns the centre gradient ∇N(0), which fields hold too.

    Examples
    --------
    The fluctuation of a linear field vanishes on any quadrilateral.

    >>> import numpy as np
    >>> from skfem import Basis, MeshQuad
    >>> mesh = MeshQuad(np.array([[0, 3, 2, 0], [0, 0, 2, 1.]]), [[0], [1], [2], [3]])
    >>> u = Basis(mesh, ElementQuad1Fluctuation()).interpolate(mesh.p[0] - mesh.p[1])
    >>> bool(np.allclose(u.grad, 0)), bool(np.allclose(centre_grad(u)[0], 1))
    (True, True)
    """

    def gbasis(
        self, mapping: Any, X: ndarray, i: int, tind: ndarray | None = None
    ) -> tuple[DiscreteField, ...]:
        """One basis function: its value, fluctuation and centre gradient."""
        (field,) = super().gbasis(mapping, X, i, tind)
        (centre,) = super().gbasis(mapping, CENTRE[0], i, tind)
        fluctuation = field.grad - centre.grad
        # scikit-fem's fields have a fixed set of slots; `grad3` is free here
        # because the third derivatives of a bilinear function vanish.
        constant = np.broadcast_to(centre.grad, fluctuation.shape)
        return (DiscreteField(np.array(field), grad=fluctuation, grad3=constant),)


def centre_grad(u: DiscreteField) -> ndarray:
    """Gradient at the element centre of a field on `ElementQuad1Fluctuation`."""
    return np.asarray(u.grad3)


def quad_basis(
    mesh: Mesh, rule: tuple[ndarray, ndarray], dimension: int = 2
) -> CellBasis:
    """Basis of the displacement on ``mesh`` with the points and weights of ``rule``.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad`.
    rule
        `CENTRE` for one point, `GAUSS` for 2×2.
    dimension
        Components of the displacement: 2 in the plane, 3 in space.
    """
    return CellBasis(mesh, ElementVector(ElementQuad1(), dimension), quadrature=rule)


def triangle_basis(mesh: Mesh, dimension: int = 2) -> CellBasis:
    """Basis of a quadratic displacement on a `skfem.MeshTri`, with `THREE` points."""
    return CellBasis(mesh, ElementVector(ElementTriP2(), dimension), quadrature=THREE)


def components(basis: AbstractBasis) -> int:
    """Number of components of the displacement, d."""
    return len(basis.nodal_dofs)


def element_numbers(basis: Any) -> ndarray:
    """Number of the element at each point of a basis, shape (n_elements, n_points)."""
    numbers = np.arange(basis.nelems) if basis.tind is None else basis.tind
    return np.broadcast_to(numbers[:, None], basis.dx.shape)


def node_positions(basis: CellBasis) -> ndarray:
    """Nodes of a basis of the displacement, shape (2, n_nodes).

    The vertices of the mesh in their order, then the middles of its edges if the
    element has nodes there.
    """
    mesh = basis.mesh
    if not basis.elem.facet_dofs:
        return mesh.p
    return np.hstack([mesh.p, mesh.p[:, mesh.facets].mean(axis=1)])


def node_dofs(basis: CellBasis) -> ndarray:
    """Unknowns of each of the nodes of `node_positions`, shape (d, n_nodes)."""
    return np.arange(basis.N).reshape(-1, components(basis)).T


class HourglassBasis(CellBasis):
    """Basis of the fluctuation at the 2×2 points, each of weight A/4 (§3.2).

    A is the reference area of the element.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad`.
    dimension
        Components of the displacement.
    **kwargs
        Passed to `skfem.CellBasis`: ``mapping``, ``dofs``, ``elements``.
    """

    def __init__(self, mesh: Mesh, dimension: int = 2, **kwargs: Any) -> None:
        element = ElementVector(ElementQuad1Fluctuation(), dimension)
        super().__init__(mesh, element, quadrature=GAUSS, **kwargs)
        centre, _ = CENTRE
        self.dx = np.abs(self.mapping.detDF(centre, self.tind)) * self.W


def displacement_gradient(basis: CellBasis, u: ndarray) -> ndarray:
    """∇u alone at the points of a basis, without the values that take most time.

    Parameters
    ----------
    basis
        Basis of the displacement.
    u
        Displacement, shape (n_unknowns,).

    Returns
    -------
    ndarray
        Shape (d, 2, n_elements, n_points).
    """
    gradient, d = 0.0, components(basis)
    nodal = u[basis.element_dofs].reshape(-1, d, 1, basis.nelems, 1)
    for of_node, (function, *_) in zip(nodal, basis.basis[::d], strict=True):
        gradient = gradient + of_node * np.asarray(function.grad)[0]
    return np.asarray(gradient)


class MeanBasis(CellBasis):
    """A `skfem.CellBasis` with the parameters of means over elements.

    ``w["share"]`` is the share of each point in the area of its element, shape
    (n_elements, n_points).

    Attributes
    ----------
    parts
        Numbers of the quadrilaterals into which each element was split, as of
        `MacroBasis`; None where the elements are those of the mesh.
    """

    parts: ndarray | None = None

    def default_parameters(self) -> dict[str, Any]:
        """Position and share."""
        share = self.dx / self.dx.sum(axis=1, keepdims=True)
        return {"x": self.global_coordinates(), "share": share}

    def from_ply_points(self, x: ndarray) -> ndarray:
        """Convert values at the ply's own points to values at these points."""
        return x

    def to_ply_points(self, x: ndarray) -> ndarray:
        """Convert values at these points to values at the ply's own points."""
        return x
